//! Benchmarks of `elm` and `elm-brdf`: see `benches/` for the criterion benches.

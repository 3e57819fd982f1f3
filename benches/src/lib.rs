//! Benchmarks of `elm` and `elm-brdf`: see `benches/` for the criterion benches.

pub mod networks;
pub mod peaks;
pub mod timing;

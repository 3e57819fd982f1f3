//! Benchmarks of `elm` and `elm-brdf`: see `benches/` for the criterion benches, `src/bin/` for
//! the programs that write the tables of `docs/`.

pub mod auto;
pub mod networks;
pub mod peaks;
pub mod peers;
pub mod stress;
pub mod tables;
pub mod timing;
pub mod topics;

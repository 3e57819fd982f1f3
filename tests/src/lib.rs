//! Tests that cross the crates; see `tests/`. What they share with the fuzz targets is
//! [`any_bytes`].

pub mod any_bytes;

// The README's code is compiled and run with the documentation tests.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;

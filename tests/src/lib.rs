//! Tests that cross the crates; see `tests/`. What they share with the fuzz targets is
//! [`any_bytes`].

pub mod any_bytes;

// The code of the README and of the guides is compiled and run with the documentation tests.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;

#[cfg(doctest)]
#[doc = include_str!("../../docs/guides/regression.md")]
struct Regression;

#[cfg(doctest)]
#[doc = include_str!("../../docs/guides/materials.md")]
struct Materials;

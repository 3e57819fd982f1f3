//! The functions and the program, in one binary: linking a database takes longer than running the tests.

// Helpers of tests are not seen as tests.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod cluster;
mod functions;
mod program;
mod readme;
mod stores;

//! What the readers and writers promise, through the public interface.

// Helpers of tests are not seen as tests.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stderr)]

mod bsdf;
mod bsdf_writer;
mod damaged;
mod dialects;
mod merl;
mod open;
mod real;
mod rgl;
mod rgl_grain;
mod round_trip;
mod scattered;
mod support;
mod tables;

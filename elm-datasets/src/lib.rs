//! Measured reflectance from files, a synthetic stand-in for it, and toy regression problems.

pub mod samples;

pub use samples::{Directions, Samples};

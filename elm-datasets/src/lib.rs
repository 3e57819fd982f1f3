//! Measured reflectance from files, a synthetic stand-in for it, and toy regression problems.

#![forbid(unsafe_code)]

pub mod analytic;
pub mod curet;
pub mod error;
pub mod measurements;
pub mod samples;
pub mod synthetic;

pub use curet::MaterialId;
pub use error::Error;
pub use measurements::{Invalid, Material, Measurements, Origin};
pub use samples::{Directions, Samples};

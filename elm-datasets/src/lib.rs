//! Measured reflectance from files, synthetic data like them, and toy regression problems.
//!
//! - [`curet`] reads and writes the CUReT database: 61 materials at 205 pairs of directions. The
//!   database itself is not part of the crate.
//! - [`synthetic`] makes a set of the same shape from formulas, the models of [`lobes`]. Both give
//!   [`Measurements`], so that whatever works on one works on the other.
//! - [`paint`] is a single synthetic material, as glossy as materials get.
//! - [`open()`] reads [`Samples`] of one material from a file of any format: your own as CSV
//!   ([`scattered`]), the [`merl`] and [`rgl`] databases, and [`pbrt`]-v2.
//! - [`color`] makes colours of spectra.
//! - [`mixture`] samples directions in proportion to any [`Brdf`].
//! - [`csv`] reads numeric tables; [`toy`] makes regression problems with known answers.
//!
//! Directions are unit vectors in the frame of the surface, which readers make of a file's angles
//! and writers turn into [`Angles`]; values are BRDF in 1/sr without the cosine. Nothing here panics on bad
//! input: every failure is an [`Error`] that names the file, the line and what was expected there.
//!
//! ```
//! use elm_datasets::{Invalid, curet, synthetic};
//! # use std::path::Path;
//!
//! # fn main() -> Result<(), elm_datasets::Error> {
//! let dir = Path::new("data/curet");
//! let set = if curet::is_present(dir) {
//!     curet::read(dir, &["felt".parse()?, "Human Skin".parse()?], Invalid::Clamp)?
//! } else {
//!     synthetic::measurements(1, &[synthetic::find("matte 01")?], Invalid::Clamp)
//! };
//! for (index, material) in set.materials.iter().enumerate() {
//!     if let Some(samples) = set.samples(index) {
//!         assert_eq!(samples.directions.len(), samples.values.nrows(), "{}", material.name);
//!     }
//! }
//! # Ok(())
//! # }
//! ```

#![forbid(unsafe_code)]

pub mod brdf;
pub mod channel;
pub mod color;
pub mod csv;
pub mod curet;
pub mod error;
mod file;
pub mod geometry;
pub mod lobes;
mod material_id;
pub mod measurements;
pub mod merl;
pub mod mixture;
mod open;
pub mod paint;
pub mod pbrt;
pub mod rgl;
pub mod samples;
pub mod sampling;
pub mod scattered;
pub mod synthetic;
mod text;
pub mod toy;

pub use brdf::Brdf;
pub use error::Error;
pub use file::STANDARD_INPUT;
pub use geometry::{Angles, DirectionPair};
pub use material_id::MaterialId;
pub use measurements::{Invalid, Material, Measurements, Origin, fill_values};
pub use open::{Format, OpenOptions, Opened, open, uncompressed};
pub use samples::Samples;
pub use sampling::Sampling;

// The README's code is compiled and run with the documentation tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

//! Other people's ways to a reflectance model, fitted as well as they can be, to be judged on the
//! same folds as a network: winning against anything less would mean nothing.
//!
//! | model | what it knows of reflectance | stored numbers |
//! |---|---|---|
//! | [`Analytic`]: Lambert to GGX on Oren-Nayar, Lafortune | a formula | 1 to 7 |
//! | [`Koenderink`] of order 2 and 8 | isotropy, reciprocity | 5, 55 |
//! | [`Neighbors`]: nearest, inverse distance | inputs | the measurements |
//! | [`RadialBasis`]: thin plate, cubic | inputs, smoothness | the measurements |
//! | [`GaussianProcess`] | inputs, smoothness of each | the measurements |
//! | [`Nbrdf`]: a published network, read from its weights | half and difference vectors | 675 for three channels |
//!
//! Every one but the last implements [`Fit`](crate::fit::Fit), treats each channel by itself (so
//! none pools materials), shares factorisations between channels, and returns a
//! [`Brdf`](elm_datasets::Brdf) that is finite, not negative, and 0 where light or viewer is at or
//! below the horizon.
//!
//! ```
//! use elm_brdf::protocol::{Folds, cross_validate};
//! use elm_brdf::baselines::{Analytic, GaussianProcess};
//! use elm_datasets::{Invalid, MaterialId, synthetic};
//!
//! let data = synthetic::measurements(1, &[MaterialId::new(39)?], Invalid::Clamp);
//! let folds = Folds::new(data.directions.len(), 5, 1)?;
//! let rmse = |method| -> elm_brdf::Result<f64> {
//!     let scores = cross_validate(method, &data, &folds, |_, _| {})?;
//!     Ok(scores[0].channels[0].held_out.rmse)
//! };
//! assert!(rmse(&Analytic::GgxOrenNayar)? < rmse(&Analytic::Lambert)?);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod analytic;
mod gaussian_process;
mod inputs;
mod kernel;
mod koenderink;
mod nbrdf;
mod neighbors;
mod radial;
mod subsampled;

pub use analytic::{Analytic, AnalyticModel, Shape};
pub use gaussian_process::{Covariance, GaussianProcess, GaussianProcessModel};
pub use koenderink::{Koenderink, KoenderinkModel};
pub use nbrdf::Nbrdf;
pub use neighbors::{Neighbors, NeighborsModel};
pub use radial::{Radial, RadialBasis, RadialBasisModel, Smoothing};
pub(crate) use subsampled::Subsampled;

#[cfg(test)]
mod tests;

//! Other people's ways to a reflectance model, fitted as well as they can be, to be judged on the
//! same folds as a network: winning against anything less would mean nothing.
//!
//! | model | what it knows of reflectance | stored numbers |
//! |---|---|---|
//! | [`Analytic`]: Lambert to GGX on Oren-Nayar, Lafortune | a formula | 1 to 7 |
//! | [`Koenderink`] of order 2 and 8 | isotropy, reciprocity | 5, 55 |
//! | [`Neighbours`]: nearest, inverse distance | inputs | the measurements |
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
//! use elm_brdf::reference::{Analytic, GaussianProcess};
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
mod neighbours;
mod radial;
mod thinned;

use elm::solve::Ridge;

pub use analytic::{Analytic, AnalyticModel, Shape};
pub use gaussian_process::{Covariance, GaussianProcess, GaussianProcessModel};
pub use koenderink::{Koenderink, KoenderinkModel};
pub use nbrdf::Nbrdf;
pub use neighbours::{Neighbours, NeighboursModel};
pub use radial::{Radial, RadialBasis, RadialBasisModel, Smoothing};
use thinned::Thinned;

use crate::features::Features;
use crate::fit::{AnyFit, boxed};
use crate::link::Link;

/// A method with the words that a table needs.
pub struct Reference {
    /// The model's name.
    pub name: String,
    /// Its inputs, where it is a regression over a set of them.
    pub features: Option<Features>,
    /// Its target, where it has a choice.
    pub link: Option<Link>,
    /// How its cost grows with the measurements.
    pub growth: Growth,
    /// Whether it is one of this project's networks after all, among the references for the sake
    /// of a table.
    pub network: bool,
    /// The method.
    pub method: Box<AnyFit>,
}

/// A model's name with its inputs and target, where it has a choice of them.
pub(crate) fn full_name(name: &str, features: Option<&str>, target: Option<&str>) -> String {
    let details: Vec<&str> = [features, target].into_iter().flatten().collect();
    if details.is_empty() {
        name.to_owned()
    } else {
        format!("{name} ({})", details.join(", "))
    }
}

/// How the cost of a fit grows with the number of measurements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Growth {
    /// In proportion, with little memory.
    Linear,
    /// In proportion, but with a grid of starts that keeps its terms for every measurement.
    Grid,
    /// With their cube, and memory with their square: one decomposition.
    Cubic,
    /// The same, once for each of many candidates.
    ManyCubic,
}

impl Reference {
    /// The model's name with its inputs and target, which tells those of one name apart.
    #[must_use]
    pub fn full_name(&self) -> String {
        let features = self.features.map(Features::name);
        full_name(&self.name, features, self.link.map(Link::name))
    }

    /// With a limit to the measurements that the method is given, where its cost grows fast:
    /// a random subset of a file with many.
    #[must_use]
    pub fn affordable(self, seed: u64) -> Self {
        let Some(most) = self.growth.most_rows() else {
            return self;
        };
        let method = self.method;
        Self {
            method: Box::new(Thinned { method, most, seed }),
            ..self
        }
    }
}

impl Growth {
    /// The most measurements that a comparison affords; `None` for no limit.
    #[must_use]
    pub fn most_rows(self) -> Option<usize> {
        match self {
            Self::Linear => None,
            Self::Grid => Some(2000),
            Self::Cubic => Some(1000),
            Self::ManyCubic => Some(400),
        }
    }
}

/// Every reference: the analytic models, Koenderink's basis, and the interpolators on the paper's
/// inputs and target, on the inputs and target that suit them best, and, for those that gain by
/// it, on reciprocal inputs.
#[must_use]
pub fn all() -> Vec<Reference> {
    with_candidates(GaussianProcess::CANDIDATES)
}

/// The same with `candidates` length scales to choose from for Gaussian processes.
fn with_candidates(candidates: usize) -> Vec<Reference> {
    let mut all: Vec<Reference> = Analytic::ALL
        .into_iter()
        .map(|model| Reference {
            name: model.name().to_owned(),
            features: None,
            link: None,
            growth: Growth::Grid,
            network: false,
            method: boxed(model),
        })
        .collect();
    all.extend([2, 8].map(|order| Reference {
        name: format!("koenderink-{order}"),
        features: None,
        link: None,
        growth: Growth::Linear,
        network: false,
        // Order 8 overfits without: 55 coefficients, some 185 measurements.
        method: boxed(Koenderink {
            order,
            solver: Ridge::leave_one_out().into(),
        }),
    }));
    for (features, link) in [
        (Features::Paper, Link::Identity),
        (Features::Paper, Link::default_log()),
        (Features::Cosines, Link::default_log()),
        (Features::ReciprocalCosines, Link::default_log()),
    ] {
        all.extend(interpolators(features, link, candidates));
    }
    all
}

fn interpolators(features: Features, link: Link, candidates: usize) -> Vec<Reference> {
    let neighbours = |count| -> Box<AnyFit> {
        boxed(Neighbours {
            features,
            link,
            count,
        })
    };
    let radial = |radial, smoothing| -> Box<AnyFit> {
        boxed(RadialBasis {
            features,
            link,
            radial,
            smoothing,
        })
    };
    use Growth::{Cubic, Linear, ManyCubic};
    use Smoothing::{Exact, LeaveOneOut};
    let methods = [
        ("nearest", Linear, neighbours(1)),
        ("inverse-distance-5", Linear, neighbours(5)),
        ("inverse-distance-all", Linear, neighbours(usize::MAX)),
        ("thin-plate", Cubic, radial(Radial::ThinPlate, Exact)),
        (
            "thin-plate-smoothed",
            Cubic,
            radial(Radial::ThinPlate, LeaveOneOut),
        ),
        ("cubic", Cubic, radial(Radial::Cubic, Exact)),
        ("cubic-smoothed", Cubic, radial(Radial::Cubic, LeaveOneOut)),
        (
            "gaussian-process",
            ManyCubic,
            boxed(GaussianProcess {
                candidates,
                ..GaussianProcess::new(features, link)
            }),
        ),
    ];
    methods
        .into_iter()
        .map(|(name, growth, method)| Reference {
            name: name.to_owned(),
            features: Some(features),
            link: Some(link),
            growth,
            network: false,
            method,
        })
        .collect()
}

#[cfg(test)]
mod tests;

//! Every model by name, with what its fit costs: what `compare` and `reproduce` judge ([`all`]), and
//! what `pareto` weighs ([`candidates`]).

mod baselines;
mod candidates;
mod networks;

pub use baselines::baselines;
#[cfg(test)]
pub(crate) use baselines::with_candidates;
pub use candidates::{Candidate, candidates};
pub use networks::POOLED;

use crate::baselines::Subsampled;
use crate::features::Features;
use crate::fit::AnyFit;
use crate::target_transform::TargetTransform;

/// A method with the words that a table needs.
pub struct ModelEntry {
    /// The model's name.
    pub name: String,
    /// Its inputs, where it is a regression over a set of them.
    pub features: Option<Features>,
    /// Its target, where it has a choice.
    pub transform: Option<TargetTransform>,
    /// How its cost grows with the measurements.
    pub cost: CostClass,
    /// Whether it is one of this project's networks.
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
pub enum CostClass {
    /// In proportion, with little memory.
    Linear,
    /// In proportion, but with a grid of starts that keeps its terms for every measurement.
    Grid,
    /// With their cube, and memory with their square: one decomposition.
    Cubic,
    /// The same, once for each of many candidates.
    ManyCubic,
}

impl ModelEntry {
    /// The model's name with its inputs and target, which tells those of one name apart.
    #[must_use]
    pub fn full_name(&self) -> String {
        let features = self.features.map(Features::name);
        full_name(
            &self.name,
            features,
            self.transform.map(TargetTransform::name),
        )
    }

    /// With a limit to the measurements that the method is given, where its cost grows fast:
    /// a random subset of a file with many.
    #[must_use]
    pub fn with_row_limit(self, seed: u64) -> Self {
        let Some(max_rows) = self.cost.max_rows() else {
            return self;
        };
        let method = self.method;
        Self {
            method: Box::new(Subsampled {
                method,
                max_rows,
                seed,
            }),
            ..self
        }
    }
}

impl CostClass {
    /// The most measurements that a comparison affords; `None` for no limit.
    #[must_use]
    pub fn max_rows(self) -> Option<usize> {
        match self {
            Self::Linear => None,
            Self::Grid => Some(2000),
            Self::Cubic => Some(1000),
            Self::ManyCubic => Some(400),
        }
    }
}

/// Every model: the [`baselines`], then this project's networks.
#[must_use]
pub fn all(seed: u64) -> Vec<ModelEntry> {
    let networks = networks::networks(seed);
    baselines().into_iter().chain(networks).collect()
}

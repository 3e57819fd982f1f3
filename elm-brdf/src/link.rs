//! Between a BRDF value and the number that the regression is asked to meet.

use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// The regression target made of a BRDF value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Link {
    /// The value itself, as in the paper; predictions may be negative.
    #[default]
    Identity,
}

impl Link {
    /// The link's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Identity => "identity",
        }
    }

    /// Targets for BRDF values in 1/sr.
    #[must_use]
    pub fn to_targets(self, values: Array2<f64>) -> Array2<f64> {
        match self {
            Self::Identity => values,
        }
    }

    /// BRDF values in 1/sr for predicted targets.
    #[must_use]
    pub fn to_values(self, targets: Array2<f64>) -> Array2<f64> {
        match self {
            Self::Identity => targets,
        }
    }
}

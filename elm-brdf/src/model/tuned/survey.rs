//! Whether a network returns more light than it receives, against what its measurements give.

use elm::Elm;
use ndarray::Array2;

use crate::albedo::{self, Node};
use crate::error::Result;
use crate::features::Features;
use crate::geometry::Pair;
use crate::link::FittedLink;

/// Angles of the light in degrees at which the albedo must be physical besides the stated ones.
const FURTHER_ANGLES: [f64; 3] = [80.0, 88.0, 89.5];

/// Where the albedo is looked at.
pub(super) struct Survey {
    /// For each angle of the light its nodes.
    angles: Vec<Vec<Node>>,
}

impl Survey {
    pub(super) fn new() -> Self {
        let angles = albedo::ANGLES.into_iter().chain(FURTHER_ANGLES);
        Self {
            angles: angles
                .map(|angle| albedo::nodes(angle.to_radians()))
                .collect(),
        }
    }

    /// By how much the albedo, for light or for viewer at one of the angles, is above 1 and above what
    /// the nearest measurements give, whose targets `nearest` says.
    pub(super) fn excess(
        &self,
        features: Features,
        network: &Elm<f64>,
        link: &FittedLink,
        nearest: impl Fn(&[Pair]) -> Array2<f64>,
    ) -> Result<f64> {
        let mut excess = 0.0_f64;
        let orders: &[bool] = if features.is_reciprocal() {
            &[false]
        } else {
            &[false, true]
        };
        for nodes in &self.angles {
            for &swapped in orders {
                let of = |node: &Node| {
                    if swapped {
                        node.pair.swapped()
                    } else {
                        node.pair
                    }
                };
                let pairs: Vec<Pair> = nodes.iter().map(of).collect();
                let sums = |targets: Array2<f64>| -> Result<Vec<f64>> {
                    Ok(albedo::sums(nodes, link.to_values(targets)?.view()))
                };
                let found = sums(network.predict(&features.compute(&pairs))?)?;
                if found.iter().all(|&albedo| albedo <= 1.0) {
                    continue;
                }
                let implied = sums(nearest(&pairs))?;
                for (found, implied) in found.into_iter().zip(implied) {
                    excess = excess.max(found - implied.max(1.0));
                }
            }
        }
        Ok(excess)
    }
}

//! Whether a network returns more light than it receives, against what its measurements give.

use std::f64::consts::FRAC_PI_2;

use elm::Elm;
use ndarray::Array2;

use crate::albedo::{self, Node};
use crate::error::Result;
use crate::features::Features;
use crate::target_transform::FittedTransform;
use elm_datasets::geometry::DirectionPair;

/// Angles of the light in degrees at which the albedo must be physical besides the stated ones.
const FURTHER_ANGLES: [f64; 3] = [80.0, 88.0, 89.5];
/// Beyond this angle, where hardly anything is measured and little is seen, half more is allowed.
const GRAZING: f64 = 86.0;
const GRAZING_ALLOWED: f64 = 1.5;

/// What a viewer may see under light of 1 from everywhere, which the directional albedo of measurements
/// that are not reciprocal to their own noise exceeds by as much.
const SEEN: f64 = 1.03;

/// How many times the albedo of the nearest measurements is physical too: a white that returns nearly all
/// light is measured no better than that.
const ALLOWED: f64 = 1.05;

/// Where the albedo is looked at.
pub(super) struct AlbedoCheck {
    /// For each angle of the light the albedo that is allowed, and its nodes.
    angles: Vec<(f64, Vec<Node>)>,
    /// What the nearest measurements give for these, in the order of light and viewer and in the other, as
    /// far as it was asked for: the same for all networks of the same inputs.
    implied: Vec<[Option<Vec<f64>>; 2]>,
}

impl AlbedoCheck {
    /// For a surface with a `grain` the light comes along and across it, where both halves of the viewers
    /// see the same.
    pub(super) fn new(anisotropic: bool) -> Self {
        let turns: &[f64] = if anisotropic {
            &[0.0, FRAC_PI_2]
        } else {
            &[0.0]
        };
        let angles = albedo::ANGLES.into_iter().chain(FURTHER_ANGLES);
        let angles: Vec<_> = angles
            .flat_map(|angle| turns.iter().map(move |&turn| (angle, turn)))
            .map(|(angle, turn)| {
                let allowed = if angle > GRAZING {
                    GRAZING_ALLOWED
                } else {
                    1.0
                };
                let mut nodes = albedo::nodes(angle.to_radians());
                for node in &mut nodes {
                    node.pair = node.pair.turned(turn);
                }
                (allowed, nodes)
            })
            .collect();
        Self {
            implied: vec![[None, None]; angles.len()],
            angles,
        }
    }

    /// By how much the albedo, for light or for viewer at one of the angles, is above 1 (near the horizon
    /// 1.5) and above a twentieth more than the nearest measurements give, whose targets `nearest` says:
    /// always the same, of the same features.
    pub(super) fn excess(
        &mut self,
        features: Features,
        network: &Elm<f64>,
        transform: &FittedTransform,
        nearest: impl Fn(&[DirectionPair]) -> Array2<f64>,
    ) -> Result<f64> {
        let mut excess = 0.0_f64;
        let orders: &[bool] = if features.is_reciprocal() {
            &[false]
        } else {
            &[false, true]
        };
        for ((allowed, nodes), implied) in self.angles.iter().zip(&mut self.implied) {
            for &swapped in orders {
                let of = |node: &Node| {
                    if swapped {
                        node.pair.swapped()
                    } else {
                        node.pair
                    }
                };
                let turned = |node: &Node| of(node).turned(features.azimuth());
                let pairs: Vec<DirectionPair> = nodes.iter().map(turned).collect();
                let sums = |targets: Array2<f64>| -> Result<Vec<f64>> {
                    Ok(albedo::sums(nodes, transform.to_values(targets)?.view()))
                };
                let allowed = if swapped { allowed.max(SEEN) } else { *allowed };
                let found = sums(network.predict(&features.compute(&pairs))?)?;
                if found.iter().all(|&albedo| albedo <= allowed) {
                    continue;
                }
                let known = &mut implied[usize::from(swapped)];
                let implied = match known.take() {
                    Some(implied) => implied,
                    None => sums(nearest(&pairs))?,
                };
                for (found, implied) in found.into_iter().zip(&implied) {
                    excess = excess.max(found - (ALLOWED * implied).max(allowed));
                }
                *known = Some(implied);
            }
        }
        Ok(excess)
    }
}

//! Directional albedo: the share of light from each angle that a surface returns.
//!
//! The directional albedo $\rho(\theta_i) = \int f \cos\theta_o \, d\omega_o$ over the hemisphere of
//! viewers is at most 1 for every surface that makes no light of its own.
//!
//! Its quadrature has nodes where reflectance varies fast: two polar grids, one about the mirror
//! direction and one about the direction of the light itself, with radii that grow from the centre by
//! the square, each weighted by how near a viewer is to its centre. The weights add up to 1, so that
//! both grids together integrate every function.

use std::f64::consts::PI;

use ndarray::ArrayView2;

use crate::error::Result;
use elm_datasets::Brdf;
use elm_datasets::geometry::{DirectionPair, cartesian};

/// The angles of the light, in degrees, at which a fit looks at the albedo.
pub const ANGLES: [f64; 7] = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0];

/// Nodes of a grid: radii, and angles about the centre over half a turn. The other half is its mirror
/// image for isotropic surfaces.
const RADII: usize = 40;
const TURNS: usize = 24;

/// Azimuths of the light over half a turn, for models that are not isotropic.
const AZIMUTHS: u32 = 4;

/// A node of the quadrature: a pair of directions, and what the value there counts in the albedo.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Node {
    pub(crate) pair: DirectionPair,
    pub(crate) weight: f64,
}

/// The nodes for light from `theta` radians.
pub(crate) fn nodes(theta: f64) -> Vec<Node> {
    let incident = cartesian(theta, 0.0);
    let mut nodes = Vec::with_capacity(2 * RADII * TURNS);
    // Centres in the plane of the light, by their signed angle from the normal.
    for (center, other) in [(-theta, theta), (theta, -theta)] {
        let (sin_c, cos_c) = center.sin_cos();
        let (sin_o, cos_o) = other.sin_cos();
        for radius in 0..RADII {
            let part = (radius as f64 + 0.5) / RADII as f64;
            let (psi, step) = (PI * part * part, 2.0 * PI * part / RADII as f64);
            let (sin_psi, cos_psi) = psi.sin_cos();
            for turn in 0..TURNS {
                let chi = (turn as f64 + 0.5) / TURNS as f64 * PI;
                let (along, aside) = (sin_psi * chi.cos(), sin_psi * chi.sin());
                let outgoing = [
                    sin_c * cos_psi + cos_c * along,
                    aside,
                    cos_c * cos_psi - sin_c * along,
                ];
                if outgoing[2] <= 0.0 {
                    continue;
                }
                // Squared distances of the chord from either centre.
                let near = 2.0 - 2.0 * cos_psi;
                let far = 2.0 - 2.0 * (sin_o * outgoing[0] + cos_o * outgoing[2]);
                let share = if near + far > 0.0 {
                    far / (near + far)
                } else {
                    0.5
                };
                // Both halves of the turn.
                let measure = 2.0 * sin_psi * step * PI / TURNS as f64;
                nodes.push(Node {
                    pair: DirectionPair { incident, outgoing },
                    weight: share * measure * outgoing[2],
                });
            }
        }
    }
    nodes
}

/// The directional albedo of each channel for light from `theta` radians from the normal.
///
/// Of a model that is not isotropic, the largest of four azimuths of the light. Of lobes wider than 2
/// degrees, narrower ones near grazing excepted, the quadrature is right to a per cent or so.
///
/// ```
/// use elm_brdf::albedo;
/// use elm_datasets::lobes::Formula;
///
/// let chalk = Formula::lambert(0.5)?;
/// assert!((albedo::directional(&chalk, 0.7)?[0] - 0.5).abs() < 2e-3);
/// # Ok::<(), elm_brdf::Error>(())
/// ```
///
/// # Errors
/// Those of [`Brdf::eval`].
pub fn directional(brdf: &dyn Brdf, theta: f64) -> Result<Vec<f64>> {
    let at = |nodes: &[Node]| -> Result<Vec<f64>> {
        let pairs: Vec<DirectionPair> = nodes.iter().map(|node| node.pair).collect();
        Ok(sums(nodes, brdf.eval(&pairs)?.view()))
    };
    let nodes = nodes(theta);
    if brdf.is_isotropic() {
        return at(&nodes);
    }
    let mut largest = vec![0.0_f64; brdf.channels()];
    for turn in 0..AZIMUTHS {
        let azimuth = PI * f64::from(turn) / f64::from(AZIMUTHS);
        // Both halves, which are no longer the same.
        let halves = [1.0, -1.0].map(|side| {
            let turned = nodes.iter().map(|node| {
                let [x, y, z] = node.pair.outgoing;
                let outgoing = [x, side * y, z];
                Node {
                    pair: DirectionPair {
                        outgoing,
                        ..node.pair
                    }
                    .turned(azimuth),
                    weight: node.weight / 2.0,
                }
            });
            turned.collect::<Vec<Node>>()
        });
        for (largest, found) in largest.iter_mut().zip(at(&halves.concat())?) {
            *largest = largest.max(found);
        }
    }
    Ok(largest)
}

/// The albedo of each channel from its values at the nodes.
pub(crate) fn sums(nodes: &[Node], values: ArrayView2<'_, f64>) -> Vec<f64> {
    let mut albedo = vec![0.0; values.ncols()];
    for (row, node) in values.rows().into_iter().zip(nodes) {
        for (sum, &value) in albedo.iter_mut().zip(row) {
            *sum += node.weight * value;
        }
    }
    albedo
}

#[cfg(test)]
mod tests {
    use super::*;
    use elm_datasets::brdf::EvalError;
    use elm_datasets::lobes::Cosines;
    use ndarray::ArrayViewMut2;

    struct Formula(fn(&Cosines) -> f64);

    impl Brdf for Formula {
        fn channels(&self) -> usize {
            1
        }

        fn eval_into(
            &self,
            pairs: &[DirectionPair],
            mut values: ArrayViewMut2<'_, f64>,
        ) -> Result<(), EvalError> {
            for (value, pair) in values.iter_mut().zip(pairs) {
                let cosines = Cosines::of(pair);
                *value = cosines.map_or(0.0, |cosines| self.0(&cosines));
            }
            Ok(())
        }
    }

    /// By the midpoint rule in sin^2 of the viewer's angle and azimuth, whose measure is the
    /// cosine's.
    fn by_brute_force(brdf: &Formula, theta: f64) -> f64 {
        let steps = 1200;
        let mut sum = 0.0;
        for row in 0..steps {
            let theta_o = ((f64::from(row) + 0.5) / f64::from(steps)).sqrt().asin();
            let pairs: Vec<DirectionPair> = (0..steps)
                .map(|column| DirectionPair {
                    incident: cartesian(theta, 0.0),
                    outgoing: cartesian(theta_o, (f64::from(column) + 0.5) / f64::from(steps) * PI),
                })
                .collect();
            sum += brdf.eval(&pairs).unwrap().sum();
        }
        sum * PI / f64::from(steps * steps)
    }

    #[test]
    fn wide_and_narrow_lobes_have_the_albedo_of_a_finer_rule() {
        let lobes: [fn(&Cosines) -> f64; 5] = [
            |_| 1.0 / PI,
            |angles| angles.ggx(0.5),
            |angles| angles.ggx(0.1),
            |angles| angles.ward(0.15),
            // Towards the light: a retroreflector.
            |angles| angles.lafortune(PI / 4.0, 300.0),
        ];
        for (number, lobe) in lobes.into_iter().enumerate() {
            let brdf = Formula(lobe);
            for degrees in [0.0_f64, 30.0, 60.0, 80.0] {
                let theta = degrees.to_radians();
                let found = directional(&brdf, theta).unwrap()[0];
                let expected = by_brute_force(&brdf, theta);
                assert!(
                    (found - expected).abs() <= 0.015 * expected,
                    "lobe {number} at {degrees}: {found} for {expected}"
                );
            }
        }
    }
}

//! Measurements themselves as a reflectance model: interpolated between, so that a picture can
//! show them beside a model fitted to them.

use elm_datasets::Samples;
use ndarray::Array2;

use crate::brdf::Brdf;
use crate::error::Result;
use crate::geometry::{Pair, dot, half_vector, pairs};

/// How many of the nearest measurements count.
const NEIGHBOURS: usize = 6;

/// Weighted mean of the nearest measurements of an isotropic, reciprocal material.
///
/// Shepard's modified weights $((R - d) / (R d))^2$, with $d$ the distance in
/// [`coordinates`] and $R$ that of the nearest measurement left out (Franke and Nielson, *Smooth
/// Interpolation of Large Sets of Scattered Data*, 1980): exact at the measurements and continuous
/// between them.
#[derive(Debug, Clone)]
pub(crate) struct Interpolated {
    points: Vec<[f64; 3]>,
    /// Shape (points, channels).
    values: Array2<f64>,
}

impl Interpolated {
    pub(crate) fn new(samples: &Samples) -> Self {
        Self {
            points: pairs(&samples.directions).iter().map(coordinates).collect(),
            values: samples.values.clone(),
        }
    }
}

/// Coordinates that do not change when light and viewer are exchanged, turned together about the
/// normal or mirrored: the tilt of the half vector, the angle between it and either direction, and
/// the sum of both cosines.
fn coordinates(pair: &Pair) -> [f64; 3] {
    let (i, o) = (pair.incident, pair.outgoing);
    let half = half_vector(i, o).unwrap_or(crate::geometry::NORMAL);
    let theta_h = half[2].clamp(-1.0, 1.0).acos();
    let theta_d = dot(half, i).clamp(-1.0, 1.0).acos();
    // A root, as highlights are narrow in theta_h.
    [2.0 * theta_h.sqrt(), theta_d, i[2] + o[2]]
}

impl Brdf for Interpolated {
    fn channels(&self) -> usize {
        self.values.ncols()
    }

    fn eval(&self, pairs: &[Pair]) -> Result<Array2<f64>> {
        let mut out = Array2::zeros((pairs.len(), self.values.ncols()));
        let mut near: Vec<(f64, usize)> = Vec::with_capacity(self.points.len());
        for (mut row, pair) in out.rows_mut().into_iter().zip(pairs) {
            let at = coordinates(pair);
            near.clear();
            near.extend(self.points.iter().enumerate().map(|(index, point)| {
                let squared: f64 = point.iter().zip(at).map(|(p, a)| (p - a) * (p - a)).sum();
                (squared.sqrt(), index)
            }));
            let order = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0);
            let count = NEIGHBOURS.min(near.len().saturating_sub(1));
            if count < near.len() {
                near.select_nth_unstable_by(count, order);
            }
            let (chosen, rest) = near.split_at_mut(count);
            chosen.sort_unstable_by(order);
            let radius = rest.first().map_or(f64::INFINITY, |first| first.0);
            let mut total = 0.0;
            for (distance, index) in chosen.iter() {
                let weight = ((radius - distance) / (radius * distance.max(1e-9))).powi(2);
                total += weight;
                row.scaled_add(weight, &self.values.row(*index));
            }
            if total > 0.0 {
                row /= total;
            } else if let Some((_, nearest)) = near.first() {
                row.assign(&self.values.row(*nearest));
            }
        }
        Ok(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use elm_datasets::{Invalid, MaterialId, synthetic};

    #[test]
    fn measurements_are_met_and_bounds_are_kept() {
        let data = synthetic::measurements(1, &[MaterialId::new(7).unwrap()], Invalid::Clamp);
        let samples = data.samples(0).unwrap();
        let model = Interpolated::new(&samples);
        let values = model.eval(&pairs(&samples.directions)).unwrap();
        // Thirty pairs are reciprocal: there the mean of two noisy values is met.
        let exact = values
            .rows()
            .into_iter()
            .zip(samples.values.rows())
            .filter(|(a, b)| (a[0] - b[0]).abs() < 1e-9)
            .count();
        assert!(exact >= 205 - 60, "{exact}");
        let swapped: Vec<Pair> = pairs(&samples.directions)
            .into_iter()
            .map(Pair::swapped)
            .collect();
        assert_eq!(model.eval(&swapped).unwrap().dim(), (205, 3));
    }
}

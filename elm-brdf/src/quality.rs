//! Estimates the errors of measurements: noise from their reciprocal pairs, and values that look
//! saturated.

use ndarray::ArrayView1;
use serde::{Deserialize, Serialize};

use elm_datasets::geometry::{DirectionPair, dot};

/// How far cosines of exchanged directions may lie apart: far more than six printed decimals of
/// an angle, far less than the steps between different measurements of a rig.
const TOLERANCE: f64 = 1e-4;

/// A saturated camera's values pile up within this share of the largest radiance.
const CLUSTER_WIDTH: f64 = 0.1;
/// The fewest measurements that make a pile.
const MIN_CLUSTER: usize = 3;
/// A highlight is at least this many times the median.
const HIGHLIGHT: f64 = 2.0;
/// By how much, as a factor, the cosines of the light in a pile must differ.
const SPAN: f64 = 1.2;

/// The standard deviation of a measurement, from pairs of measurements that a reciprocal material
/// makes equal.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct NoiseFloor {
    /// $\sigma = \sqrt{\tfrac12 \operatorname{mean}(a - b)^2}$ over the pairs, in 1/sr. No
    /// reciprocal model can be expected to have a smaller root mean squared error, but for errors
    /// that the pairs share or that depend on the directions and can be learnt.
    pub sigma: f64,
    /// How many pairs there are.
    pub pairs: usize,
}

impl NoiseFloor {
    /// Of one channel of BRDF values in 1/sr; `None` without pairs, or where `reciprocal_pairs` does not
    /// belong to these values.
    #[must_use]
    pub fn of(reciprocal_pairs: &[(usize, usize)], values: ArrayView1<'_, f64>) -> Option<Self> {
        let mut squares = 0.0;
        for &(a, b) in reciprocal_pairs {
            squares += (values.get(a)? - values.get(b)?).powi(2);
        }
        (!reciprocal_pairs.is_empty()).then(|| Self {
            sigma: (squares / (2.0 * reciprocal_pairs.len() as f64)).sqrt(),
            pairs: reciprocal_pairs.len(),
        })
    }
}

/// Whether light, viewer and normal lie in one plane in all of these pairs, to half a degree: what
/// a surface looks like from beside the plane of incidence is then not known.
#[must_use]
pub fn in_one_plane(pairs: &[DirectionPair]) -> bool {
    let across = |pair: &DirectionPair| {
        let (l, v) = (pair.incident, pair.outgoing);
        (l[0] * v[1] - l[1] * v[0]).abs()
    };
    // The size of the product of both sines and that of the azimuth between them.
    !pairs.is_empty() && pairs.iter().all(|pair| across(pair) <= 8.7e-3)
}

/// The pairs of measurements whose light and viewer are exchanged, up to a turn or a reflection of
/// the surface about its normal: indices into `pairs`, the smaller first, ascending.
///
/// Directions that are their own exchange, with light and viewer equally far from the normal, say
/// nothing about noise and are left out.
#[must_use]
pub fn reciprocal_pairs(pairs: &[DirectionPair]) -> Vec<(usize, usize)> {
    let near = |a: f64, b: f64| (a - b).abs() <= TOLERANCE;
    // By the light, so that few candidates are left for each.
    let mut order: Vec<usize> = (0..pairs.len()).collect();
    order.sort_by(|&a, &b| pairs[a].incident[2].total_cmp(&pairs[b].incident[2]));
    let mut found = Vec::new();
    for (a, pair) in pairs.iter().enumerate() {
        let [light, viewer] = [pair.incident[2], pair.outgoing[2]];
        if near(light, viewer) {
            continue;
        }
        let first = order.partition_point(|&b| pairs[b].incident[2] < viewer - TOLERANCE);
        let candidates = order[first..].iter().copied();
        for b in candidates.take_while(|&b| near(pairs[b].incident[2], viewer)) {
            let other = &pairs[b];
            let between = dot(other.incident, other.outgoing);
            if a < b
                && near(other.outgoing[2], light)
                && near(between, dot(pair.incident, pair.outgoing))
            {
                found.push((a, b));
            }
        }
    }
    found.sort_unstable();
    found
}

/// The measurements of one channel that look saturated: ascending indices into `values`, BRDF in
/// 1/sr.
///
/// A camera saturates at a radiance, and radiance is BRDF times $\cos\theta_i$. So the rule, from
/// the data alone, is a pile at the top of the radiances: of the highlights (BRDF at least twice
/// the median) those within 10 % of the channel's largest radiance, if there are at least three,
/// no fewer than in the 10 % below, and under lights whose cosines differ by a factor of at least
/// 1.2. A highlight that is not cut off has no reason to give the same radiance there; a surface
/// without highlights has, and is not suspected.
///
/// What saturates gently, or in a single measurement, is not found.
#[must_use]
pub fn saturated(pairs: &[DirectionPair], values: ArrayView1<'_, f64>) -> Vec<usize> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(&median) = sorted.get(sorted.len() / 2) else {
        return Vec::new();
    };
    let radiance = |row: usize| values[row] * pairs[row].incident[2];
    let rows = || 0..values.len().min(pairs.len());
    let largest = rows().map(radiance).fold(0.0, f64::max);
    let highlights = rows().filter(|&row| values[row] >= HIGHLIGHT * median && values[row] > 0.0);
    let (top, rest): (Vec<usize>, Vec<usize>) =
        highlights.partition(|&row| radiance(row) >= (1.0 - CLUSTER_WIDTH) * largest);
    let below = rest.into_iter();
    let below = below.filter(|&row| radiance(row) >= (1.0 - 2.0 * CLUSTER_WIDTH) * largest);
    let cosines = || top.iter().map(|&row| pairs[row].incident[2]);
    let (least, most) = (
        cosines().fold(f64::INFINITY, f64::min),
        cosines().fold(0.0, f64::max),
    );
    let piled = top.len() >= MIN_CLUSTER && top.len() >= below.count() && most >= SPAN * least;
    if piled { top } else { Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use elm_datasets::geometry::cartesian;
    use elm_datasets::lobes;
    use elm_datasets::{Invalid, MaterialId, curet::rig, synthetic};
    use ndarray::{Array1, array};

    fn pair(theta_i: f64, theta_o: f64, phi: f64) -> DirectionPair {
        DirectionPair {
            incident: cartesian(theta_i, 0.4),
            outgoing: cartesian(theta_o, 0.4 + phi),
        }
    }

    #[test]
    fn one_plane_is_told_from_all_others() {
        use std::f64::consts::PI;
        let plane: Vec<DirectionPair> = (0..80)
            .map(|row| {
                pair(
                    f64::from(row) / 60.0,
                    0.35,
                    if row % 2 == 0 { PI } else { 0.0 },
                )
            })
            .collect();
        assert!(in_one_plane(&plane));
        assert!(!in_one_plane(
            &[&plane[..], &[pair(0.3, 0.4, 0.5)]].concat()
        ));
        assert!(!in_one_plane(&[]));
    }

    #[test]
    fn exchanged_pairs_are_found_up_to_turns_and_reflections_and_once() {
        let measured = [
            pair(0.3, 0.9, 1.0),
            pair(0.5, 0.5, 1.0),
            // Turned, and reflected.
            pair(0.9, 0.3, -1.0),
            pair(0.9, 0.3, 1.3),
            pair(0.9, 0.3, 1.0),
        ];
        assert_eq!(reciprocal_pairs(&measured), [(0, 2), (0, 4)]);
        assert!(reciprocal_pairs(&[]).is_empty());
    }

    #[test]
    fn the_rig_has_thirty_exchanged_pairs() {
        // Counted on the database's own table of directions by an independent program.
        assert_eq!(reciprocal_pairs(&rig::directions()).len(), 30);
    }

    #[test]
    fn the_noise_floor_is_the_deviation_of_one_measurement() {
        let values = array![1.0, 2.0, 1.4, 5.0, 1.0];
        let floor = NoiseFloor::of(&[(0, 2), (1, 1)], values.view()).unwrap();
        // Differences 0.4 and 0: the mean square is 0.08, and half of it belongs to each.
        assert_abs_diff_eq!(floor.sigma, 0.2, epsilon = 1e-15);
        assert_eq!(floor.pairs, 2);
        assert_eq!(NoiseFloor::of(&[], values.view()), None);
        assert_eq!(NoiseFloor::of(&[(0, 9)], values.view()), None);
    }

    #[test]
    fn the_noise_floor_finds_the_noise_put_in() {
        // The synthetic material 13 and its like are dark; 5 is matte, with 4.1 % of noise.
        let data = synthetic::measurements(1, &[MaterialId::new(5).unwrap()], Invalid::Keep);
        let pairs = &data.directions;
        let red = data.materials[0].values.column(0);
        let floor = NoiseFloor::of(&reciprocal_pairs(pairs), red).unwrap();
        let level = (red.mapv(|v| v * v).sum() / red.len() as f64).sqrt();
        // 30 pairs know a deviation to 1 / sqrt(60), 13 %; three times that.
        assert!(
            (floor.sigma / level / 0.041 - 1.0).abs() < 0.4,
            "{}",
            floor.sigma / level
        );
    }

    /// A glossy surface in the rig, its radiance cut off at this share of its largest.
    fn cut_at(share: f64) -> Vec<usize> {
        let pairs = rig::directions();
        let glossy = |d| lobes::lambert(d, 0.2) + lobes::ward(d, 0.1, 0.3);
        let exact: Array1<f64> = pairs.iter().map(glossy).collect();
        let radiance = |row: usize| exact[row] * pairs[row].incident[2];
        let largest = (0..exact.len()).map(radiance).fold(0.0, f64::max);
        let values = Array1::from_shape_fn(exact.len(), |row| {
            exact[row].min(share * largest / pairs[row].incident[2])
        });
        let found = saturated(&pairs, values.view());
        for &row in &found {
            assert!(values[row] * pairs[row].incident[2] >= 0.9 * share * largest);
        }
        found
    }

    #[test]
    fn cut_off_highlights_are_found_and_whole_ones_are_not() {
        assert!(cut_at(1.0).is_empty());
        assert!(cut_at(0.5).len() >= 3);
    }

    #[test]
    fn surfaces_without_highlights_are_not_suspected() {
        let pairs = rig::directions();
        for value in [0.0, 0.3] {
            let values = Array1::from_elem(pairs.len(), value);
            assert!(saturated(&pairs, values.view()).is_empty());
        }
        assert!(saturated(&[], Array1::zeros(0).view()).is_empty());
    }
}

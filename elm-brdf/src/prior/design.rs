//! Chooses which directions to measure of a material that is fitted with a prior.

use ndarray::{Array1, Axis, Zip};

use super::Prior;
use crate::error::{Error, Result};
use elm_datasets::brdf::check_directions;
use elm_datasets::geometry::DirectionPair;

/// The variance that no measurement explains, relative to the prior's mean variance.
const NOISE: f64 = 0.01;
/// Size of the general part, as a variance relative to the part that materials teach: the middle
/// one of those that fits average over.
const GENERAL: f64 = 0.03;

impl Prior {
    /// The `count` most telling of these pairs, the best first: each makes the expected squared error
    /// over *all* of `pairs` as small as one more measurement can.
    ///
    /// A design for the BRDF, not for its logarithm: what is bright in the mean counts more. It asks
    /// for no measured value, so that it can be had before the first measurement.
    ///
    /// K. Chaloner, I. Verdinelli, *Bayesian Experimental Design: A Review*, Statistical Science
    /// 10(3), 1995 (A-optimality, by a greedy choice).
    ///
    /// ```
    /// use elm_brdf::prior::PriorParams;
    /// use elm_datasets::{Invalid, MaterialId, synthetic};
    /// use ndarray::Array2;
    ///
    /// let ids: Vec<MaterialId> = MaterialId::all().take(12).collect();
    /// let data = synthetic::measurements(1, &ids, Invalid::Clamp);
    /// let pairs = &data.directions;
    /// let values = Array2::from_shape_fn((205, 12), |(row, m)| data.materials[m].values[[row, 0]]);
    /// let prior = PriorParams::default().build(&pairs, values.view())?;
    /// let first = prior.design(&pairs, 20)?;
    /// assert_eq!(first.len(), 20);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Parameter`] for more than there are pairs; directions that are none.
    pub fn design(&self, pairs: &[DirectionPair], count: usize) -> Result<Vec<usize>> {
        check_directions(pairs)?;
        if count > pairs.len() {
            return Err(Error::Parameter {
                name: "count",
                value: count as f64,
                expected: "at most the number of pairs",
            });
        }
        let h = self.map.transform(&self.features.compute(pairs))?;
        let mean = h.dot(&self.mean.beta) + self.mean.constant[0];
        let taught = h.dot(&self.deviations.beta) + &self.deviations.constant;
        let mut covariance = taught.dot(&taught.t());
        let mean_variance = covariance.diag().sum() / pairs.len() as f64;
        let general = h.dot(&h.t());
        let mean_general = general.diag().sum() / pairs.len() as f64;
        covariance.scaled_add(GENERAL * mean_variance / mean_general, &general);
        let noise = NOISE * mean_variance;
        // By how much a value changes with its target, of ln(1 + f/o), in units of o.
        let slopes: Array1<f64> = mean.mapv(f64::exp);

        let mut order = Vec::new();
        let mut left = vec![true; pairs.len()];
        while order.len() < count {
            let mut best: Option<(f64, usize)> = None;
            for candidate in (0..pairs.len()).filter(|&c| left[c]) {
                let column = covariance.column(candidate);
                let gain = Zip::from(&column)
                    .and(&slopes)
                    .fold(0.0, |sum, &k, &slope| sum + (k * slope).powi(2))
                    / (column[candidate] + noise);
                if best.is_none_or(|(most, _)| gain > most) {
                    best = Some((gain, candidate));
                }
            }
            let Some((_, chosen)) = best else { break };
            left[chosen] = false;
            order.push(chosen);
            // What is known once it is measured.
            let column = covariance.column(chosen).to_owned();
            let scaled = &column / (column[chosen] + noise);
            let outer = column
                .insert_axis(Axis(1))
                .dot(&scaled.insert_axis(Axis(0)));
            covariance -= &outer;
        }
        Ok(order)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use elm_datasets::{Invalid, MaterialId, synthetic};
    use ndarray::Array2;

    use crate::prior::PriorParams;

    #[test]
    fn a_design_repeats_no_direction_and_begins_like_a_shorter_one() {
        let ids: Vec<MaterialId> = MaterialId::all().take(6).collect();
        let data = synthetic::measurements(1, &ids, Invalid::Clamp);
        let pairs = &data.directions;
        let values = Array2::from_shape_fn((205, 6), |(row, m)| data.materials[m].values[[row, 0]]);
        let params = PriorParams {
            neurons: 60,
            ..PriorParams::default()
        };
        let prior = params.build(pairs, values.view()).unwrap();
        let whole = prior.design(pairs, 205).unwrap();
        let mut sorted = whole.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..205).collect::<Vec<_>>());
        assert_eq!(prior.design(pairs, 9).unwrap(), whole[..9]);
        assert!(prior.design(pairs, 206).is_err());
    }
}

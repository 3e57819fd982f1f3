//! Checks that new rows resemble those that the standardization was measured on.
//!
//! A scaler that was measured on too few rows, or on others, does harm without a trace in the fit: an
//! input that was constant there is lost, and one that hardly varied is magnified until every neuron
//! is saturated.

use ndarray::{ArrayView1, ArrayView2};

use super::Accumulator;
use crate::dataset::TargetDim;
use crate::error::{Error, Result};
use crate::scalar::Scalar;

/// Deviations from the mean beyond which a value is far off.
const FAR: f64 = 10.0;
/// One row in this many may be far off in an input: by Chebyshev's inequality no distribution with the
/// scaler's mean and deviation has more.
const ROWS_PER_FAR: u64 = 100;
/// This many may be far off in any case: a few impossible values are not another distribution.
const FAR_AT_LEAST: u64 = 10;

impl<A: Scalar, D: TargetDim> Accumulator<A, D> {
    /// For each input the rows so far, with these, that are far off.
    ///
    /// # Errors
    /// [`Error::ConstantInput`] and [`Error::UnlikeRows`].
    pub(super) fn far_off(
        &self,
        x: ArrayView2<'_, A>,
        weights: Option<ArrayView1<'_, A>>,
    ) -> Result<Vec<u64>> {
        let mut far = self.far.clone();
        let Some(scaler) = self.map.scaler() else {
            return Ok(far);
        };
        if self.unlike_rows {
            return Ok(far);
        }
        let present = |row: usize| weights.is_none_or(|weights| weights[row] > A::zero());
        let bound = A::from_f64(FAR);
        let mut rows = self.weighted_rows;
        for (row, values) in x
            .rows()
            .into_iter()
            .enumerate()
            .filter(|(row, _)| present(*row))
        {
            rows = rows.saturating_add(1);
            let columns = scaler.mean().into_iter().zip(scaler.factor());
            for ((input, &value), (&mean, &factor)) in values.iter().enumerate().zip(columns) {
                if factor > A::zero() {
                    let off = (value - mean).abs() * factor > bound;
                    far[input] = far[input].saturating_add(u64::from(off));
                } else if value != mean && self.uses(input) {
                    return Err(Error::ConstantInput {
                        input,
                        row,
                        constant: mean.as_f64(),
                        value: value.as_f64(),
                    });
                }
            }
        }
        let allowed = FAR_AT_LEAST.saturating_add(rows / ROWS_PER_FAR);
        let unlike = |input: &usize| far[*input] > allowed && self.uses(*input);
        match (0..far.len()).find(unlike) {
            Some(input) => Err(Error::UnlikeRows {
                input,
                far: far[input],
                rows,
            }),
            None => Ok(far),
        }
    }

    /// Whether the network looks at an input: one whose scale is 0 is ignored on purpose.
    fn uses(&self, input: usize) -> bool {
        let weights = self.hidden().weights();
        let mut scales = self
            .hidden()
            .groups()
            .iter()
            .filter_map(|g| g.input_scales());
        let columns = self.map.columns_of(input);
        let weighs = |&column: &usize| weights.row(column).iter().any(|w| *w != A::zero());
        self.map.direct_links()
            || columns.iter().any(weighs)
            || scales.any(|scales| columns.iter().any(|&c| scales[c] != A::zero()))
    }
}

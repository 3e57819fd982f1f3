//! Converts what an accumulator keeps into the problem that a batch fit would have prepared.

use std::ops::Range;

use ndarray::{Array1, ArrayView1, Axis, s};

use super::Accumulator;
use crate::dataset::TargetDim;
use crate::error::Result;
use crate::linalg::QrFactor;
use crate::scalar::{Scalar, power_of_two};
use crate::solve::design_svd::DesignSvd;
use crate::solve::equilibration::Equilibration;

impl<A: Scalar, D: TargetDim> Accumulator<A, D> {
    /// The problem in the coordinates of its singular vectors, as a batch fit has it.
    pub(super) fn spectrum(&self) -> Result<DesignSvd<A>> {
        if self.keeps_products() {
            return self.moments()?.spectrum();
        }
        let (hidden, targets) = self.places();
        let neurons = hidden.len();
        // Neurons share one scale, so that the singular values are those of the whole matrix.
        let scales = self.scales.slice(s![hidden.clone()]);
        let mut hidden_scale = scales
            .iter()
            .fold(A::min_positive_value(), |m, s| m.max(*s));
        let block = |rows: &Range<usize>, columns: &Range<usize>| {
            let block = s![rows.clone(), columns.clone()];
            self.kept.slice(block).to_owned()
        };
        let mut h = block(&hidden, &hidden);
        h *= &(&scales / hidden_scale);
        let mut target_scale = self.scales.slice(s![targets.clone()]).to_owned();
        let mut t = block(&hidden, &targets);
        let mut rest = block(&targets, &targets);
        let (mut hidden_mean, mut target_mean) =
            (Array1::zeros(neurons), Array1::zeros(self.outputs));
        if self.intercept {
            hidden_mean = hidden.clone().map(|place| self.mean(place)).collect();
            target_mean = targets.clone().map(|place| self.mean(place)).collect();
            for (column, place) in hidden.enumerate() {
                if self.is_constant(place) {
                    h.column_mut(column).fill(A::zero());
                }
            }
            for (output, place) in targets.enumerate() {
                if self.is_constant(place) {
                    t.column_mut(output).fill(A::zero());
                    rest.column_mut(output).fill(A::zero());
                }
            }
            // A large constant is gone now, and what is left may be small.
            let largest =
                |values: ArrayView1<'_, A>| values.iter().fold(A::zero(), |m: A, v| m.max(v.abs()));
            let size = h.columns().into_iter().map(largest).fold(A::zero(), A::max);
            let shrunk = power_of_two(size);
            h.mapv_inplace(|v| v / shrunk);
            hidden_scale *= shrunk;
            for (output, scale) in target_scale.iter_mut().enumerate() {
                let size = largest(t.column(output)).max(largest(rest.column(output)));
                let shrunk = power_of_two(size);
                t.column_mut(output).mapv_inplace(|v| v / shrunk);
                rest.column_mut(output).mapv_inplace(|v| v / shrunk);
                *scale *= shrunk;
            }
        }
        // The column of ones is as long as the root of the weights' sum.
        let total_weight = if self.intercept {
            (self.kept[[0, 0]] * self.scales[0]).powi(2)
        } else {
            A::one()
        };
        let frame = Equilibration {
            total_weight,
            hidden_mean,
            target_mean,
            hidden_scale,
            target_scale,
            ..self.frame()
        };
        let triangle = QrFactor {
            r: h,
            qtb: t,
            residual_ss: rest.map_axis(Axis(0), |column| column.dot(&column)),
        };
        DesignSvd::of_triangle(triangle, frame)
    }

    /// The columns of neurons and of outputs.
    pub(super) fn places(&self) -> (Range<usize>, Range<usize>) {
        let first = usize::from(self.intercept);
        let end = self.columns() - self.outputs;
        (first..end, end..self.columns())
    }

    /// What the numbers of rows say; of means and scales there are none yet.
    pub(super) fn frame(&self) -> Equilibration<A> {
        Equilibration {
            rows: usize::try_from(self.rows).unwrap_or(usize::MAX),
            weighted_rows: usize::try_from(self.weighted_rows).unwrap_or(usize::MAX),
            intercept: self.intercept,
            root_weights: Array1::zeros(0),
            weight_scale: A::one(),
            total_weight: A::one(),
            hidden_mean: Array1::zeros(self.places().0.len()),
            target_mean: Array1::zeros(self.outputs),
            hidden_scale: A::one(),
            target_scale: Array1::ones(self.outputs),
        }
    }

    /// From an entry of the triangle's column, over the first row's diagonal, to a value of that column.
    fn unscaled(&self, column: usize) -> A {
        self.scales[column] / self.scales[0] / self.kept[[0, 0]]
    }

    /// The mean of a column; for sums with an intercept.
    fn mean(&self, column: usize) -> A {
        let shift = self.shift.as_ref().map_or(A::zero(), |s| s[column - 1]);
        shift + self.kept[[0, column]] * self.unscaled(column)
    }

    /// Whether a column is a constant. What centering leaves of one is the rounding of its values, and would
    /// pass for a feature; it does not grow with the rows.
    fn is_constant(&self, column: usize) -> bool {
        let left = self.kept.slice(s![1..=column, column]);
        let deviation = left.dot(&left).sqrt() * self.unscaled(column).abs();
        deviation <= A::from_f64(4.0) * A::epsilon() * self.mean(column).abs()
    }
}

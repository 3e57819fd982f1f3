//! Scales a problem before it is factorized, and unscales its solution.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, Zip};

use super::LeastSquares;
use crate::dataset::counts;
use crate::scalar::{Scalar, power_of_two};
use crate::stats;

/// The scales and means that were taken out of a problem.
#[derive(Debug, Clone)]
pub(crate) struct Equilibration<A: Scalar> {
    pub(crate) rows: usize,
    /// Rows whose weight is not 0.
    pub(crate) weighted_rows: usize,
    pub(crate) intercept: bool,
    /// Square roots of the row weights, the largest being 1; without weights all are 1.
    pub(crate) root_weights: Array1<A>,
    /// The largest row weight, which the others were divided by.
    pub(crate) weight_scale: A,
    /// The sum of the weights after that.
    pub(crate) total_weight: A,
    pub(crate) hidden_mean: Array1<A>,
    pub(crate) target_mean: Array1<A>,
    /// Powers of two that the matrices were divided by.
    pub(crate) hidden_scale: A,
    pub(crate) target_scale: Array1<A>,
}

impl<A: Scalar> Equilibration<A> {
    /// How many rows each stands for, where weights can be such [counts]; 1 for a row that does not count.
    pub(crate) fn counts(&self) -> Option<Array1<A>> {
        let roots = self.root_weights.iter();
        let counts = counts(roots.map(|root| root.as_f64().powi(2)))?.into_iter();
        Some(counts.map(|count| A::from_f64(count.max(1.0))).collect())
    }

    /// Whether some rows that count weigh more than others.
    pub(crate) fn weights_differ(&self) -> bool {
        let counted = |root: &A| *root > A::zero() && *root < A::one();
        self.root_weights.iter().any(counted)
    }

    /// What the weights alone say; of means and scales there are none yet.
    pub(crate) fn of_weights(
        rows: usize,
        weights: Option<&ArrayView1<'_, A>>,
        intercept: bool,
    ) -> Self {
        let (weight_scale, weights) = unit_weights(rows, weights);
        Self {
            rows,
            weighted_rows: weights.iter().filter(|w| **w > A::zero()).count(),
            intercept,
            total_weight: A::from_f64(stats::sum(weights.iter().map(|w| w.as_f64()))),
            root_weights: weights.mapv_into(A::sqrt),
            weight_scale,
            hidden_mean: Array1::zeros(0),
            target_mean: Array1::zeros(0),
            hidden_scale: A::one(),
            target_scale: Array1::zeros(0),
        }
    }

    /// In another type.
    pub(crate) fn narrow<B: Scalar>(self) -> Equilibration<B> {
        let value = |value: A| B::from_f64(value.as_f64());
        Equilibration {
            rows: self.rows,
            weighted_rows: self.weighted_rows,
            intercept: self.intercept,
            root_weights: self.root_weights.mapv_into_any(value),
            weight_scale: value(self.weight_scale),
            total_weight: value(self.total_weight),
            hidden_mean: self.hidden_mean.mapv_into_any(value),
            target_mean: self.target_mean.mapv_into_any(value),
            hidden_scale: value(self.hidden_scale),
            target_scale: self.target_scale.mapv_into_any(value),
        }
    }

    /// The unit vector that an intercept spans among the weighted rows,
    /// $\sqrt{w_i / \sum w}$; all 0 without one.
    pub(crate) fn constant_direction(&self) -> Array1<A> {
        if self.intercept {
            &self.root_weights / self.total_weight.sqrt()
        } else {
            Array1::zeros(self.rows)
        }
    }

    /// Output weights of the scaled problem in the problem's own units.
    pub(crate) fn unscale(&self, mut beta: Array2<A>) -> Array2<A> {
        for (mut column, &scale) in beta.columns_mut().into_iter().zip(&self.target_scale) {
            column.mapv_inplace(|b| b * (scale / self.hidden_scale));
        }
        beta
    }

    /// The sum of squares of each column of the scaled matrix before it was centered.
    pub(crate) fn column_ss(&self, centered: ArrayView2<'_, A>) -> Array1<A> {
        let spread = centered.map_axis(Axis(0), |column| column.dot(&column));
        let mean = self.hidden_mean.mapv(|m| m / self.hidden_scale);
        spread + mean.mapv_into(|m| m * m * self.total_weight)
    }

    /// The constant of each output that goes with these output weights.
    pub(crate) fn constant(&self, beta: &Array2<A>) -> Array1<A> {
        &self.target_mean - &self.hidden_mean.dot(beta)
    }

    /// A singular value in the problem's own units.
    pub(crate) fn singular_value_in_original_units(&self, s: A) -> f64 {
        s.as_f64() * (self.hidden_scale.as_f64() * self.weight_scale.as_f64().sqrt())
    }

    /// Norms of (weighted) residuals in the problem's own units.
    pub(crate) fn residual_norms_in_original_units(
        &self,
        norms: impl Iterator<Item = f64>,
    ) -> Vec<f64> {
        let root_weight = self.weight_scale.as_f64().sqrt();
        norms
            .zip(&self.target_scale)
            .map(|(norm, scale)| norm * scale.as_f64() * root_weight)
            .collect()
    }

    /// Whether this many singular vectors, with the intercept, reach every weighted row. What is
    /// left of the targets is then rounding error, and leave-one-out would divide one rounding
    /// error by another.
    pub(crate) fn spanned_by(&self, rank: usize) -> bool {
        rank + usize::from(self.intercept) >= self.weighted_rows
    }
}

/// The problem with rows weighted, columns centered for the intercept, and everything scaled by
/// powers of two into the middle of the floating-point range. Rows of weight 0 are 0.
pub(crate) struct EquilibratedProblem<A: Scalar> {
    pub(crate) hidden: Array2<A>,
    pub(crate) targets: Array2<A>,
    pub(crate) frame: Equilibration<A>,
}

impl<A: Scalar> EquilibratedProblem<A> {
    pub(crate) fn new(problem: &LeastSquares<'_, A>) -> Self {
        let rows = problem.rows();
        let frame = Equilibration::of_weights(rows, problem.weights.as_ref(), problem.intercept);
        let (_, weights) = unit_weights(rows, problem.weights.as_ref());
        let root_weights = &frame.root_weights;

        let largest = weighted_magnitudes(problem.hidden, root_weights);
        let mut hidden_scale = power_of_two(largest.iter().fold(A::zero(), |m, x| m.max(*x)));
        let mut target_scale =
            weighted_magnitudes(problem.targets, root_weights).mapv_into(power_of_two);
        let mut hidden = problem.hidden.mapv(|h| h / hidden_scale);
        let mut targets = &problem.targets / &target_scale;
        for (row, weight) in weights.iter().enumerate() {
            // A row that is absent may hold anything, even what would overflow.
            if *weight == A::zero() {
                hidden.row_mut(row).fill(A::zero());
                targets.row_mut(row).fill(A::zero());
            }
        }
        let mut hidden_mean = Array1::zeros(hidden.ncols());
        let mut target_mean = Array1::zeros(targets.ncols());
        if problem.intercept {
            hidden_mean = center(&mut hidden, &weights);
            hidden_mean.mapv_inplace(|m| m * hidden_scale);
            target_mean = center(&mut targets, &weights);
            target_mean *= &target_scale;
        }
        if problem.weights.is_some() {
            let roots = root_weights.view().insert_axis(Axis(1));
            hidden *= &roots;
            targets *= &roots;
        }
        if problem.intercept {
            // A large constant column is gone now, and what is left may be small.
            let shrunk = power_of_two(hidden.iter().fold(A::zero(), |m, x| m.max(x.abs())));
            if shrunk < A::one() {
                hidden.mapv_inplace(|h| h / shrunk);
                hidden_scale *= shrunk;
            }
            for (mut column, scale) in targets.columns_mut().into_iter().zip(&mut target_scale) {
                let shrunk = power_of_two(column.iter().fold(A::zero(), |m, x| m.max(x.abs())));
                if shrunk < A::one() {
                    column.mapv_inplace(|t| t / shrunk);
                    *scale *= shrunk;
                }
            }
        }
        let frame = Equilibration {
            hidden_mean,
            target_mean,
            hidden_scale,
            target_scale,
            ..frame
        };
        Self {
            hidden,
            targets,
            frame,
        }
    }
}

/// The largest weight, and all divided by it: 1e300 and 1e-300 are then as good as 1.
fn unit_weights<A: Scalar>(rows: usize, weights: Option<&ArrayView1<'_, A>>) -> (A, Array1<A>) {
    let Some(weights) = weights else {
        return (A::one(), Array1::ones(rows));
    };
    let largest = weights.iter().fold(A::zero(), |m, w| m.max(*w));
    (largest, weights.mapv(|w| w / largest))
}

/// For each column the largest $\sqrt{w_i} |a_{ij}|$, in `f64`.
pub(super) fn magnitudes<A: Scalar>(matrix: ArrayView2<'_, A>, roots: &Array1<f64>) -> Array1<f64> {
    let mut largest = Array1::zeros(matrix.ncols());
    for (row, root) in matrix.rows().into_iter().zip(roots) {
        for (largest, value) in largest.iter_mut().zip(row) {
            *largest = f64::max(*largest, root * value.as_f64().abs());
        }
    }
    largest
}

/// For each column the largest $\sqrt{w_i} |a_{ij}|$.
pub(crate) fn weighted_magnitudes<A: Scalar>(
    matrix: ArrayView2<'_, A>,
    roots: &Array1<A>,
) -> Array1<A> {
    let mut largest = Array1::zeros(matrix.ncols());
    for (row, &root) in matrix.rows().into_iter().zip(roots) {
        Zip::from(&mut largest).and(row).for_each(|m: &mut A, &x| {
            *m = m.max(root * x.abs());
        });
    }
    largest
}

/// Subtracts each column's weighted mean and returns the means. A column whose values differ by
/// no more than rounding becomes exactly 0: its noise would pass for a feature. (These values are
/// computed, and rounded as they are; how many there are does not matter.)
fn center<A: Scalar>(matrix: &mut Array2<A>, weights: &Array1<A>) -> Array1<A> {
    // Weights lie in [0, 1], so this is 1 for every row that is there.
    let largest = weighted_magnitudes(matrix.view(), &weights.mapv(A::ceil));
    let mut mean = vec![0.0; matrix.ncols()];
    // Twice: the first mean has rounded, and what it missed is the mean of what is left.
    for _ in 0..2 {
        let missed = stats::means(matrix.view(), weights.view());
        for mut row in matrix.rows_mut() {
            for (value, &missed) in row.iter_mut().zip(&missed) {
                // Narrowed last, as a mean may have more digits than the values.
                *value = A::from_f64(value.as_f64() - missed);
            }
        }
        mean.iter_mut()
            .zip(missed)
            .for_each(|(m, missed)| *m += missed);
    }
    for (mut column, &largest) in matrix.columns_mut().into_iter().zip(&largest) {
        let bound = A::from_f64(4.0) * A::epsilon() * largest;
        let varies = Zip::from(&column)
            .and(weights)
            .any(|x, w| *w > A::zero() && x.abs() > bound);
        if !varies {
            column.fill(A::zero());
        }
    }
    mean.into_iter().map(A::from_f64).collect()
}

//! Sums of products of a hidden-layer matrix and its targets: what a search over strengths of
//! regularisation, and over folds, needs of the rows.
//!
//! Sums of folds add up and are taken away again, so that a cross-validation reads every row once. The
//! normal equations lose half of the digits, which for the strengths that a model evaluated in single
//! precision can bear (see [`rounding`]) leaves enough.

use elm::solve::Cholesky;
use ndarray::linalg::general_mat_mul;
use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, ShapeBuilder, Slice, concatenate};

use crate::error::Result;

/// The weakest strength, relative to the sum of the columns' squares: below, the normal equations have
/// no digits.
pub(super) const WEAKEST: f64 = 1e-12;
/// Columns of a block of a product of which half is needed.
const BLOCK: usize = 96;

/// Sums of products of the columns of a hidden-layer matrix and of a constant with each other and with
/// the targets.
#[derive(Debug, Clone)]
pub(super) struct NormalEquations {
    /// Of the hidden columns and the constant, shape (neurons + 1, neurons + 1); on and below the
    /// diagonal.
    gram: Array2<f64>,
    /// Of these with the targets, shape (neurons + 1, outputs).
    cross: Array2<f64>,
}

/// Columns up to which a product is made row by row: its time is that of reading the rows, which a general
/// product copies first.
const THIN: usize = 8;

/// $A B$ for a $B$ of few columns.
fn thin_product(a: ArrayView2<'_, f64>, b: &Array2<f64>) -> Array2<f64> {
    if b.ncols() > THIN {
        return a.dot(b);
    }
    let columns = b.t().as_standard_layout().into_owned();
    let mut product = Array2::zeros((a.nrows(), b.ncols()));
    for (mut to, row) in product.rows_mut().into_iter().zip(a.rows()) {
        for (to, column) in to.iter_mut().zip(columns.rows()) {
            *to = row.dot(&column);
        }
    }
    product
}

/// $A^T B$ for a $B$ of few columns.
fn thin_transposed_product(a: ArrayView2<'_, f64>, b: ArrayView2<'_, f64>) -> Array2<f64> {
    if b.ncols() > THIN {
        return a.t().dot(&b);
    }
    let mut product = Array2::zeros((b.ncols(), a.ncols()));
    for (row, factors) in a.rows().into_iter().zip(b.rows()) {
        for (mut to, &factor) in product.rows_mut().into_iter().zip(factors) {
            to.scaled_add(factor, &row);
        }
    }
    product.reversed_axes()
}

/// Output weights, and what they leave.
#[derive(Debug, Clone)]
pub(super) struct Weights {
    /// Shape (neurons, outputs).
    pub(super) beta: Array2<f64>,
    pub(super) intercept: Array1<f64>,
}

impl Weights {
    /// The outputs of all of these, one after the other.
    pub(super) fn joined<'a>(all: impl Iterator<Item = &'a Self>) -> Self {
        let (mut betas, mut intercepts) = (Vec::new(), Vec::new());
        for weights in all {
            betas.push(weights.beta.view());
            intercepts.extend(&weights.intercept);
        }
        Self {
            beta: concatenate(Axis(1), &betas).unwrap_or_default(),
            intercept: intercepts.into(),
        }
    }

    pub(super) fn apply(&self, h: ArrayView2<'_, f64>) -> Array2<f64> {
        thin_product(h, &self.beta) + &self.intercept
    }
}

impl NormalEquations {
    /// `h` has shape (rows, neurons), `t` (rows, outputs); `weights` are those of squares.
    pub(super) fn of(
        h: ArrayView2<'_, f64>,
        t: ArrayView2<'_, f64>,
        weights: Option<&Array1<f64>>,
    ) -> Self {
        let (rows, neurons) = h.dim();
        let mut bordered = Array2::ones((rows, neurons + 1));
        bordered
            .slice_axis_mut(Axis(1), Slice::from(..neurons))
            .assign(&h);
        let weighted = weights.map(|weights| &bordered * &weights.view().insert_axis(Axis(1)));
        let left = weighted.as_ref().unwrap_or(&bordered);
        Self {
            gram: lower_product(left.t(), bordered.view()),
            cross: thin_transposed_product(left.view(), t),
        }
    }

    /// The same rows with other targets; `h` and `weights` must be those that these were made of.
    pub(super) fn again(
        &self,
        h: &Array2<f64>,
        t: &Array2<f64>,
        weights: Option<&Array1<f64>>,
    ) -> Self {
        let weighted = weights.map(|weights| t * &weights.view().insert_axis(Axis(1)));
        let weighted = weighted.as_ref().unwrap_or(t);
        let mut cross = Array2::zeros((h.ncols() + 1, t.ncols()));
        let mut hidden = cross.slice_axis_mut(Axis(0), Slice::from(..h.ncols()));
        hidden.assign(&thin_transposed_product(h.view(), weighted.view()));
        cross.row_mut(h.ncols()).assign(&weighted.sum_axis(Axis(0)));
        Self {
            gram: self.gram.clone(),
            cross,
        }
    }

    /// The same hidden columns, and nothing of the targets.
    pub(super) fn without_targets(&self) -> Self {
        Self {
            gram: self.gram.clone(),
            cross: Array2::zeros(self.cross.dim()),
        }
    }

    /// Adds `times` the products with the targets of `other`.
    pub(super) fn add_cross(&mut self, other: &Self, times: f64) {
        self.cross.scaled_add(times, &other.cross);
    }

    /// Adds `times * other`; -1 subtracts it.
    pub(super) fn add(&mut self, other: &Self, times: f64) {
        self.gram.scaled_add(times, &other.gram);
        self.cross.scaled_add(times, &other.cross);
    }

    /// The sum of the squares of all hidden columns about their means, which strengths are relative
    /// to; of the columns themselves where none varies by more than rounding, and 1 where that is 0.
    pub(super) fn scale(&self) -> f64 {
        let neurons = self.gram.nrows() - 1;
        let total = self.gram[[neurons, neurons]];
        let square = |k: usize| self.gram[[k, k]];
        let about_mean = |k: usize| (square(k) - self.gram[[neurons, k]].powi(2) / total).max(0.0);
        let squares: f64 = (0..neurons).map(square).sum();
        let sum: f64 = (0..neurons).map(about_mean).sum();
        let rounded = WEAKEST * squares;
        [sum, squares]
            .into_iter()
            .find(|&sum| sum > rounded && sum.is_finite())
            .unwrap_or(1.0)
    }

    /// The triangle for a strength that is added to the squares of all columns but the constant;
    /// `None` where rounding has made them indefinite.
    pub(super) fn factor(&self, strength: f64) -> Option<Factor> {
        let neurons = self.gram.nrows() - 1;
        let mut shifted = self.gram.clone();
        for k in 0..neurons {
            shifted[[k, k]] += strength;
        }
        let triangle = Cholesky::new(shifted).ok()?;
        Some(Factor { triangle })
    }
}

/// A factorised problem.
pub(super) struct Factor {
    triangle: Cholesky<f64>,
}

impl Factor {
    /// The output weights for the targets of `equations`, whose triangle this is.
    pub(super) fn solve(&self, equations: &NormalEquations) -> Result<Weights> {
        let x = self.triangle.solve(&equations.cross)?;
        let (beta, constant) = x.view().split_at(Axis(0), x.nrows() - 1);
        Ok(Weights {
            beta: beta.to_owned(),
            intercept: constant.row(0).to_owned(),
        })
    }
}

/// The product of `left` and `right` on and below its diagonal, block by block; above it is anything.
fn lower_product(left: ArrayView2<'_, f64>, right: ArrayView2<'_, f64>) -> Array2<f64> {
    let n = right.ncols();
    let mut product = Array2::zeros((n, n).f());
    for first in (0..n).step_by(BLOCK) {
        let columns = Slice::from(first..(first + BLOCK).min(n));
        let mut target = product.slice_axis_mut(Axis(1), columns);
        target.slice_axis_inplace(Axis(0), Slice::from(first..));
        let rows = left.slice_axis(Axis(0), Slice::from(first..));
        let columns = right.slice_axis(Axis(1), columns);
        general_mat_mul(1.0, &rows, &columns, 0.0, &mut target);
    }
    product
}

/// How far single precision may move a prediction, as a standard deviation for each output: half an
/// ulp of the largest value that a neuron has and of the sum that it is applied to, of which each
/// is as likely to be high as low.
///
/// `reach` has, for each neuron, the size of the sum that its function is applied to.
pub(super) fn rounding(beta: ArrayView2<'_, f64>, reach: ArrayView1<'_, f64>) -> Vec<f64> {
    let u = f64::from(f32::EPSILON) / 2.0;
    let of = |column: ArrayView1<'_, f64>| {
        let sum: f64 = column
            .iter()
            .zip(reach)
            .map(|(beta, reach)| (beta * (1.0 + reach)).powi(2))
            .sum();
        u * sum.sqrt()
    };
    beta.columns().into_iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use elm::cross_validation::CrossValidator;
    use elm::solve::LeastSquares;

    fn problem(rows: usize, neurons: usize) -> (Array2<f64>, Array2<f64>) {
        let h = Array2::from_shape_fn((rows, neurons), |(i, j)| {
            ((i as f64 * 0.37 + 1.0) * (j as f64 * 0.11 + 0.3)).sin()
        });
        let t = Array2::from_shape_fn((rows, 2), |(i, j)| {
            (i as f64 * 0.05 * (j + 1) as f64).cos() + 3.0
        });
        (h, t)
    }

    /// The library's own solver, by singular values, is the truth.
    #[test]
    fn weights_are_those_of_the_singular_value_decomposition() {
        for (rows, neurons) in [(150, 101), (60, 101)] {
            let (h, t) = problem(rows, neurons);
            let equations = NormalEquations::of(h.view(), t.view(), None);
            let validator =
                CrossValidator::new(&LeastSquares::new(&h, &t).unwrap().with_intercept(true))
                    .unwrap();
            for relative in [1e-6, 1e-3] {
                let solution = validator.solve(&[relative]).unwrap();
                // The same absolute strength; the library's are relative.
                let largest = solution.diagnosis.largest_singular_value.powi(2);
                let factor = equations.factor(relative * largest).unwrap();
                let weights = factor.solve(&equations).unwrap();
                let predicted = weights.apply(h.view());
                let expected = h.dot(&solution.beta) + &solution.intercept;
                // Of normal equations of n columns: n epsilon times their condition, which the
                // strength keeps at its reciprocal (Higham 2002, ch. 10).
                let size = t.iter().map(|t| t * t).sum::<f64>().sqrt();
                let error = (neurons + 1) as f64 * f64::EPSILON / relative * size;
                assert_abs_diff_eq!(predicted, expected, epsilon = error);
            }
        }
    }

    #[test]
    fn a_fold_taken_away_is_a_fold_never_added() {
        let (h, t) = problem(90, 20);
        let weights = Array1::from_shape_fn(90, |i| 1.0 + (i % 3) as f64);
        let part = |rows: std::ops::Range<usize>| {
            NormalEquations::of(
                h.slice_axis(Axis(0), Slice::from(rows.clone())),
                t.slice_axis(Axis(0), Slice::from(rows.clone())),
                Some(&weights.slice_axis(Axis(0), Slice::from(rows)).to_owned()),
            )
        };
        let mut rest = part(0..90);
        rest.add(&part(60..90), -1.0);
        let direct = part(0..60);
        let (one, other) = (
            rest.factor(0.1).unwrap().solve(&rest).unwrap(),
            direct.factor(0.1).unwrap().solve(&direct).unwrap(),
        );
        assert_abs_diff_eq!(one.beta, other.beta, epsilon = 1e-9);
        assert_abs_diff_eq!(one.intercept, other.intercept, epsilon = 1e-9);
    }

    #[test]
    fn what_is_indefinite_or_not_a_number_has_no_factor() {
        let (h, t) = problem(30, 5);
        let equations = NormalEquations::of(h.view(), t.view(), None);
        assert!(equations.factor(-1e6).is_none());
        assert!(equations.factor(f64::NAN).is_none());
    }
}

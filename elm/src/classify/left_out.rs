//! Scores of rows by the fits that have not seen them.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, s};

use crate::error::Result;
use crate::linalg::Backend;
use crate::network::Elm;
use crate::scalar::Scalar;
use crate::solve::Cholesky;
use crate::solve::lanczos::largest_eigenvalue;
use crate::solve::symmetric::Symmetric;

/// Rows that a calibration looks at, at most.
const ROWS: usize = 20_000;
/// Rows whose features are there at once.
const TILE: usize = 512;
/// The least ridge, relative to the largest squared singular value, that leverages are computed with: the
/// normal equations have no digits below.
const MIN_RIDGE: f64 = 1e-12;

/// Rows of a fit, and their scores without them.
pub(super) struct LeftOut {
    /// Shape (rows, outputs).
    pub(super) scores: Array2<f64>,
    /// Which rows they are.
    pub(super) rows: Vec<usize>,
}

impl LeftOut {
    /// Scores of all rows, or evenly spread ones of many, for a network that was fitted to them by ridge of
    /// one strength for all outputs. A row of weight above 1 loses one unit of it, so that a row of weight 2
    /// is two rows.
    ///
    /// The residual without a row is $r / (1 - h)$, the leverage $h$ by the Cholesky factor of
    /// $\tilde H^T W \tilde H + \lambda s_1^2$, columns centered where there is an intercept.
    pub(super) fn new<A: Scalar, W: Fn(usize) -> f64>(
        model: &Elm<A>,
        intercept: bool,
        x: ArrayView2<'_, A>,
        targets: &Array2<A>,
        weight: W,
    ) -> Result<Self> {
        let features = |range: std::ops::Range<usize>| {
            let h = model.map().apply(x.slice(s![range, ..]));
            A::widen(h.view()).into_owned()
        };
        let moments = Moments::new(x.nrows(), intercept, features, &weight);
        let lambda = model.diagnosis().lambda.first().copied().unwrap_or(0.0);
        let factor = moments.factor(lambda)?;
        let present: Vec<usize> = (0..x.nrows()).filter(|&row| weight(row) > 0.0).collect();
        let stride = present.len().div_ceil(ROWS).max(1);
        let rows: Vec<usize> = present.into_iter().step_by(stride).collect();
        let mut scores = Array2::zeros((rows.len(), model.outputs()));
        for (part, mut out) in rows
            .chunks(TILE)
            .zip(scores.axis_chunks_iter_mut(Axis(0), TILE))
        {
            let h = model.map().apply(x.select(Axis(0), part).view());
            let fitted = h.dot(&model.beta()) + model.intercept();
            let h = A::widen(h.view()).into_owned() - &moments.mean;
            let half = factor.forward(&h.t().to_owned())?;
            let unit =
                half.map_axis(Axis(0), |column| column.dot(&column)) + moments.constant_share();
            for (place, &row) in part.iter().enumerate() {
                let h = unit[place] * weight(row).min(1.0);
                for (output, score) in out.row_mut(place).iter_mut().enumerate() {
                    let target = targets[[row, output]].as_f64();
                    *score = without(target, fitted[[place, output]].as_f64(), h);
                }
            }
        }
        Ok(Self { scores, rows })
    }
}

/// The score of a row without it, held to where scores are.
pub(super) fn without(target: f64, fitted: f64, leverage: f64) -> f64 {
    let score = target - (target - fitted) / (1.0 - leverage).max(f64::EPSILON);
    score.clamp(LOWEST, HIGHEST)
}

/// What scores without a row are held to: the margin around 0 and 1 that predictions have.
const LOWEST: f64 = -crate::bounds::MARGIN;
const HIGHEST: f64 = 1.0 + crate::bounds::MARGIN;

/// Weighted sums of products of features.
struct Moments {
    /// About the mean, where there is an intercept.
    products: Array2<f64>,
    mean: Array1<f64>,
    /// The sum of weights, where there is an intercept.
    total: Option<f64>,
}

impl Moments {
    fn new(
        rows: usize,
        intercept: bool,
        features: impl Fn(std::ops::Range<usize>) -> Array2<f64>,
        weight: impl Fn(usize) -> f64,
    ) -> Self {
        let first = features(0..rows.min(TILE));
        let columns = first.ncols();
        // Near the mean, so that little is taken off in the end.
        let shift = match first.mean_axis(Axis(0)) {
            Some(mean) if intercept => mean,
            _ => Array1::zeros(columns),
        };
        let (mut products, mut sum) = (Array2::zeros((columns, columns)), Array1::zeros(columns));
        let mut total = 0.0;
        for start in (0..rows).step_by(TILE) {
            let range = start..rows.min(start + TILE);
            let h = features(range.clone()) - &shift;
            let weights: Array1<f64> = range.map(&weight).collect();
            let weighted = &h * &weights.view().insert_axis(Axis(1));
            products += &f64::product(h.t(), weighted.view());
            sum += &weighted.sum_axis(Axis(0));
            total += weights.sum();
        }
        if intercept {
            let beyond = &sum / total;
            products -= &outer(beyond.view(), sum.view());
            return Self {
                products,
                mean: shift + beyond,
                total: Some(total),
            };
        }
        Self {
            products,
            mean: shift,
            total: None,
        }
    }

    fn constant_share(&self) -> f64 {
        self.total.map_or(0.0, f64::recip)
    }

    fn factor(&self, lambda: f64) -> Result<Cholesky<f64>> {
        let largest = largest_eigenvalue(&Symmetric::of_lower(&self.products)).unwrap_or(1.0);
        let mut products = self.products.clone();
        let ridge = largest * lambda.max(MIN_RIDGE);
        products.diag_mut().mapv_inplace(|d| d + ridge);
        Cholesky::new(products)
    }
}

fn outer(a: ArrayView1<'_, f64>, b: ArrayView1<'_, f64>) -> Array2<f64> {
    let (a, b) = (a.insert_axis(Axis(1)), b.insert_axis(Axis(0)));
    &a * &b
}

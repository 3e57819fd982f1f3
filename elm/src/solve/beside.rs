//! Ridge of many layers beside columns that all of them share, which are factorized once.
//!
//! With shared columns $U$ in the coordinates of their singular vectors, $U^T U = \Lambda$ is diagonal,
//! and the normal equations of $[H, U]$ are those of $H$ alone with
//! $$S = H^T H + \lambda - B (\Lambda + \lambda)^{-1} B^T, \qquad B = H^T U,$$
//! for a matrix. A layer then costs its products with rows and columns, and each strength tried a
//! Cholesky factorization of the size of the layer, whatever the number of columns.
//!
//! The strength is that of the least generalized cross-validation score (Golub, Heath and Wahba, 1979).
//! All is in `f64`, of sums of squares: errors below 1e-7 of the targets' deviation are rounding here.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, ShapeBuilder, s};

use crate::error::Result;
use crate::linalg::{Backend, Eigen};

/// Columns that many layers are solved beside, of rows that count, all of positive weight.
pub(crate) struct SharedColumns {
    /// Centered and weighted, in the coordinates of their singular vectors, shape (rows, directions).
    rotated: Array2<f64>,
    /// The squared singular values.
    squares: Array1<f64>,
    /// Shape (columns, directions).
    vectors: Array2<f64>,
    mean: Array1<f64>,
    /// Roots of the weights, whose mean is 1; nothing where all are alike.
    roots: Option<Array1<f64>>,
    /// Centered and weighted, shape (rows, outputs).
    targets: Array2<f64>,
    target_mean: Array1<f64>,
    /// Shape (directions, outputs).
    products: Array2<f64>,
    /// The sum of squares of all targets.
    total: f64,
}

/// A layer solved beside [`SharedColumns`].
#[derive(Debug, Clone)]
pub(crate) struct Beside {
    /// Output weights of the layer and, after them, of the shared columns, shape (both, outputs).
    pub(crate) beta: Array2<f64>,
    pub(crate) intercept: Array1<f64>,
    /// On the scale of [`strength`].
    pub(crate) step: i32,
    /// The generalized cross-validation estimate of the squared error, the sum over outputs.
    pub(crate) score: f64,
}

/// Steps to a decade of the strengths that are tried, and the weakest and the strongest of them.
const PER_DECADE: f64 = 2.0;
const STEPS: (i32, i32) = (-20, 4);
/// The strength to begin at.
pub(crate) const FIRST_STEP: i32 = -9;

/// A strength per row of a step.
fn strength(step: i32) -> f64 {
    10.0_f64.powf(f64::from(step) / PER_DECADE)
}

/// What a layer has to do with rows, targets and shared columns.
struct Products {
    /// $H^T H$, the lower half.
    gram: Array2<f64>,
    /// $B$, shape (neurons, directions).
    cross: Array2<f64>,
    /// Shape (neurons, outputs).
    right: Array2<f64>,
    mean: Array1<f64>,
}

/// A layer at one strength.
struct Solved {
    own: Array2<f64>,
    shared: Array2<f64>,
    score: f64,
}

impl SharedColumns {
    /// Of columns `u`, shape (rows, columns), and targets, with positive weights where rows have any.
    ///
    /// # Errors
    /// [`Error::NoConvergence`](crate::Error::NoConvergence).
    pub(crate) fn new(
        u: ArrayView2<'_, f64>,
        targets: ArrayView2<'_, f64>,
        weights: Option<ArrayView1<'_, f64>>,
    ) -> Result<Self> {
        let roots = weights.map(|weights| {
            let mean = weights.sum() / weights.len() as f64;
            weights.mapv(|weight| (weight / mean).sqrt())
        });
        let (centered, mean) = center(u, roots.as_ref());
        let (targets, target_mean) = center(targets, roots.as_ref());
        let gram = f64::gram(centered.view());
        let Eigen { values: s, vt } = f64::eigen(gram.view())?;
        let largest = s.first().copied().unwrap_or(0.0);
        let kept = s.iter().filter(|s| **s > 1e-13 * largest).count();
        let vectors = vt.slice(s![..kept, ..]).t().to_owned();
        let rotated = f64::product(centered.view(), vectors.view());
        Ok(Self {
            products: f64::product(rotated.t(), targets.view()),
            squares: s.slice(s![..kept]).to_owned(),
            total: targets.iter().map(|t| t * t).sum(),
            rotated,
            vectors,
            mean,
            roots,
            targets,
            target_mean,
        })
    }

    /// Solves for a layer's output weights and the shared columns', given what the layer makes of the
    /// rows, shape (rows, neurons); `start` is the step of a strength that may be near the best.
    pub(crate) fn solve(&self, hidden: ArrayView2<'_, f64>, start: i32) -> Option<Beside> {
        let (hidden, mean) = center(hidden, self.roots.as_ref());
        let products = Products {
            gram: f64::gram(hidden.view()),
            cross: f64::product(hidden.t(), self.rotated.view()),
            right: f64::product(hidden.t(), self.targets.view()),
            mean,
        };
        let (step, solved) = self.best(&products, start)?;
        let outputs = self.targets.ncols();
        let neurons = products.mean.len();
        let columns = self.mean.len();
        let mut beta = Array2::zeros((neurons + columns, outputs));
        beta.slice_mut(s![..neurons, ..]).assign(&solved.own);
        let shared = f64::product(self.vectors.view(), solved.shared.view());
        beta.slice_mut(s![neurons.., ..]).assign(&shared);
        let intercept =
            &self.target_mean - &solved.own.t().dot(&products.mean) - shared.t().dot(&self.mean);
        Some(Beside {
            beta,
            intercept,
            step,
            score: solved.score,
        })
    }

    /// Downhill from `start`, by whole decades first.
    fn best(&self, products: &Products, start: i32) -> Option<(i32, Solved)> {
        let mut here = start.clamp(STEPS.0, STEPS.1);
        let mut best = self.at(products, strength(here));
        let mut jump = 2;
        while jump > 0 {
            let mut moved = false;
            for direction in [jump, -jump] {
                loop {
                    let next = here + direction;
                    if next < STEPS.0 || next > STEPS.1 {
                        break;
                    }
                    let tried = self.at(products, strength(next));
                    let better = match (&tried, &best) {
                        (Some(tried), Some(best)) => tried.score < best.score,
                        (Some(_), None) => true,
                        (None, _) => false,
                    };
                    if !better {
                        break;
                    }
                    (here, best, moved) = (next, tried, true);
                }
                if moved {
                    break;
                }
            }
            jump /= 2;
        }
        best.map(|best| (here, best))
    }

    /// Nothing where the numbers do not carry the strength.
    fn at(&self, products: &Products, per_row: f64) -> Option<Solved> {
        let rows = self.targets.nrows() as f64;
        let lambda = per_row * rows;
        let held = self.squares.mapv(|square| (square + lambda).recip());
        let roots = held.mapv(f64::sqrt);
        let scaled = &products.cross * &roots;
        let mut matrix = products.gram.clone();
        let taken = f64::gram(scaled.t());
        matrix -= &taken;
        matrix.diag_mut().mapv_inplace(|d| d + lambda);
        let factor = f64::cholesky(matrix).ok()?;
        let against = &self.products * &held.view().insert_axis(Axis(1));
        let right = &products.right - &f64::product(products.cross.view(), against.view());
        // The right sides, and what the trace of the inverse is made of, at once.
        let neurons = products.mean.len();
        let (outputs, directions) = (right.ncols(), held.len());
        let mut sides = Array2::zeros((neurons, outputs + directions + neurons).f());
        sides.slice_mut(s![.., ..outputs]).assign(&right);
        let crossed = &products.cross * &held;
        sides
            .slice_mut(s![.., outputs..outputs + directions])
            .assign(&crossed);
        sides
            .slice_mut(s![.., outputs + directions..])
            .diag_mut()
            .fill(1.0);
        let solved = f64::solve_lower(&factor, sides.view()).ok()?;
        let (forward, rest) = solved.view().split_at(Axis(1), outputs);
        let own = f64::solve_lower_transposed(&factor, forward).ok()?;
        let back = f64::product(products.cross.t(), own.view());
        let shared = (&self.products - &back) * held.view().insert_axis(Axis(1));
        let inverse_trace = held.sum() + rest.iter().map(|x| x * x).sum::<f64>();
        let freedom = (neurons + directions) as f64 - lambda * inverse_trace;
        let explained = (&products.right * &own).sum() + (&self.products * &shared).sum();
        let size = own.iter().chain(&shared).map(|b| b * b).sum::<f64>();
        let residual = (self.total - explained - lambda * size).max(1e-15 * self.total);
        let spare = rows - 1.0 - freedom;
        if spare.is_nan() || spare <= 0.0 {
            return None;
        }
        Some(Solved {
            own,
            shared,
            score: residual * rows / (spare * spare),
        })
    }
}

impl Beside {
    /// Predictions, given what layer and shared columns make of the rows.
    pub(crate) fn predict(
        &self,
        hidden: ArrayView2<'_, f64>,
        shared: ArrayView2<'_, f64>,
    ) -> Array2<f64> {
        let (own, rest) = self.beta.view().split_at(Axis(0), hidden.ncols());
        f64::product(hidden, own) + f64::product(shared, rest) + &self.intercept
    }
}

/// Columns less their weighted means, times the roots of the weights; and the means.
fn center(matrix: ArrayView2<'_, f64>, roots: Option<&Array1<f64>>) -> (Array2<f64>, Array1<f64>) {
    let rows = matrix.nrows() as f64;
    let mean = match roots {
        None => matrix.sum_axis(Axis(0)) / rows,
        Some(roots) => {
            let weights = roots.mapv(|root| root * root);
            matrix.t().dot(&weights) / weights.sum()
        }
    };
    let mut centered = &matrix - &mean;
    if let Some(roots) = roots {
        centered *= &roots.view().insert_axis(Axis(1));
    }
    (centered, mean)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::concatenate;

    /// A symmetric matrix of its lower half.
    fn whole(lower: &Array2<f64>) -> Array2<f64> {
        Array2::from_shape_fn(lower.dim(), |(i, j)| lower[[i.max(j), i.min(j)]])
    }

    fn wave(rows: usize, columns: usize, step: f64) -> Array2<f64> {
        Array2::from_shape_fn((rows, columns), |(i, j)| {
            ((i * (j + 2)) as f64 * step + j as f64).sin()
        })
    }

    #[test]
    fn the_answer_is_that_of_ridge_on_all_columns() {
        let (u, h) = (wave(90, 7, 0.13), wave(90, 12, 0.71));
        let t = wave(90, 2, 0.37) + u.slice(s![.., ..2]);
        let weights = Array1::from_shape_fn(90, |i| 1.0 + (i % 5) as f64);
        let all = concatenate(Axis(1), &[h.view(), u.view()]).unwrap();
        for weights in [None, Some(weights)] {
            let columns = SharedColumns::new(
                u.view(),
                t.view(),
                weights.as_ref().map(|weights| weights.view()),
            )
            .unwrap();
            let found = columns.solve(h.view(), FIRST_STEP).unwrap();
            // The normal equations of all columns at once, about weighted means.
            let roots = weights
                .as_ref()
                .map(|w| (w / w.mean().unwrap()).mapv(f64::sqrt));
            let (x, mean) = center(all.view(), roots.as_ref());
            let (y, target_mean) = center(t.view(), roots.as_ref());
            let mut gram = whole(&f64::gram(x.view()));
            gram.diag_mut()
                .mapv_inplace(|d| d + 90.0 * strength(found.step));
            let factor = f64::cholesky(gram).unwrap();
            let half = f64::solve_lower(&factor, x.t().dot(&y).view()).unwrap();
            let beta = f64::solve_lower_transposed(&factor, half.view()).unwrap();
            let intercept = &target_mean - &beta.t().dot(&mean);
            approx::assert_relative_eq!(found.beta, beta, max_relative = 1e-6);
            approx::assert_relative_eq!(found.intercept, intercept, max_relative = 1e-6);
        }
    }

    #[test]
    fn a_factor_of_all_weights_says_nothing() {
        let (u, h, t) = (wave(50, 4, 0.2), wave(50, 6, 0.9), wave(50, 1, 0.4));
        let score = |factor: f64| {
            let weights = Array1::from_shape_fn(50, |i| factor * (1.0 + (i % 3) as f64));
            let columns = SharedColumns::new(u.view(), t.view(), Some(weights.view())).unwrap();
            columns.solve(h.view(), FIRST_STEP).unwrap().score
        };
        approx::assert_relative_eq!(score(1.0), score(1e6), max_relative = 1e-9);
    }
}

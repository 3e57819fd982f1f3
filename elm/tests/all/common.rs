//! Random problems with known structure, shared by the integration tests.

use elm::Scalar;
use elm::solve::{Diagnosis, LeastSquares, Ridge, Solution, Solver};
use ndarray::{Array1, Array2, Axis, concatenate};
use ndarray_rand::RandomExt;
use ndarray_rand::rand_distr::{StandardNormal, Uniform};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Independent normal entries, drawn in `f64`.
pub(crate) fn normal<A: Scalar>(rows: usize, columns: usize, seed: u64) -> Array2<A> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let draws: Array2<f64> = Array2::random_using((rows, columns), StandardNormal, &mut rng);
    draws.mapv(A::from_f64)
}

/// Small integers, so that products of such matrices are exact in either precision.
pub(crate) fn integers<A: Scalar>(rows: usize, columns: usize, seed: u64) -> Array2<A> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let draws = Array2::random_using((rows, columns), Uniform::new(-4, 5).unwrap(), &mut rng);
    draws.mapv(|v: i32| A::from_f64(f64::from(v)))
}

/// A matrix of exactly the given rank (at most; almost always equal).
pub(crate) fn deficient<A: Scalar>(
    rows: usize,
    columns: usize,
    rank: usize,
    seed: u64,
) -> Array2<A> {
    integers::<A>(rows, rank, seed).dot(&integers::<A>(rank, columns, seed + 1))
}

/// Weights between 0.1 and 3.
pub(crate) fn weights<A: Scalar>(rows: usize, seed: u64) -> Array1<A> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    Array1::random_using(rows, Uniform::new(0.1, 3.0).unwrap(), &mut rng).mapv(A::from_f64)
}

/// Largest magnitude.
pub(crate) fn largest<A: Scalar>(matrix: &Array2<A>) -> f64 {
    matrix.iter().fold(0.0, |m, v| m.max(v.as_f64().abs()))
}

/// Frobenius norm.
pub(crate) fn frobenius<A: Scalar>(matrix: &Array2<A>) -> f64 {
    matrix
        .iter()
        .map(|v| v.as_f64().powi(2))
        .sum::<f64>()
        .sqrt()
}

/// What rounding errors are amplified by on the way to the output weights: the condition of the
/// matrix, or where it was not found that of the regularized normal equations.
pub(crate) fn amplification(diagnosis: &Diagnosis) -> f64 {
    diagnosis.condition.unwrap_or_else(|| {
        let weakest = diagnosis.lambda.iter().copied().fold(1.0, f64::min);
        2.0 / weakest
    })
}

/// A least-squares problem that owns its data, so that rows can be taken away.
#[derive(Debug, Clone)]
pub(crate) struct Problem<A: Scalar> {
    pub(crate) hidden: Array2<A>,
    pub(crate) targets: Array2<A>,
    pub(crate) weights: Option<Array1<A>>,
    pub(crate) intercept: bool,
}

impl<A: Scalar> Problem<A> {
    pub(crate) fn new(hidden: Array2<A>, targets: Array2<A>) -> Self {
        Self {
            hidden,
            targets,
            weights: None,
            intercept: false,
        }
    }

    /// Targets that the matrix explains in part: `outputs` columns with noise of this size.
    pub(crate) fn noisy(hidden: Array2<A>, outputs: usize, noise: f64, seed: u64) -> Self {
        let truth = normal::<A>(hidden.ncols(), outputs, seed);
        let noise = normal::<A>(hidden.nrows(), outputs, seed + 1).mapv(|v| v * A::from_f64(noise));
        let targets = hidden.dot(&truth) + noise;
        Self::new(hidden, targets)
    }

    pub(crate) fn weighted(mut self, weights: Array1<A>) -> Self {
        self.weights = Some(weights);
        self
    }

    pub(crate) fn with_intercept(mut self) -> Self {
        self.intercept = true;
        self
    }

    pub(crate) fn view(&self) -> LeastSquares<'_, A> {
        let problem = LeastSquares::new(&self.hidden, &self.targets)
            .unwrap()
            .with_intercept(self.intercept);
        match &self.weights {
            Some(weights) => problem.with_weights(weights).unwrap(),
            None => problem,
        }
    }

    pub(crate) fn solve(&self, solver: impl Into<Solver>) -> Solution<A> {
        solver.into().solve(&self.view()).unwrap()
    }

    /// These rows, in this order; a row may come twice.
    pub(crate) fn rows(&self, rows: &[usize]) -> Self {
        Self {
            hidden: self.hidden.select(Axis(0), rows),
            targets: self.targets.select(Axis(0), rows),
            weights: self.weights.as_ref().map(|w| w.select(Axis(0), rows)),
            intercept: self.intercept,
        }
    }

    /// What ridge with this absolute strength predicts for the rows `out` when it is fitted
    /// without them, shape (`out`, outputs).
    pub(crate) fn refit_without(&self, out: &[usize], absolute: f64) -> Array2<A> {
        self.fit_without(out, absolute).select(Axis(0), out)
    }

    /// The same for all rows.
    pub(crate) fn fit_without(&self, out: &[usize], absolute: f64) -> Array2<A> {
        let kept: Vec<usize> = (0..self.hidden.nrows())
            .filter(|row| !out.contains(row))
            .collect();
        let kept = self.rows(&kept);
        // The first solve only asks for the largest singular value, which lambda is relative to.
        let s = kept
            .solve(Ridge::relative(1.0))
            .diagnosis
            .largest_singular_value;
        let solution = if s > 0.0 {
            kept.solve(Ridge::relative(absolute / (s * s)))
        } else {
            kept.solve(Ridge::relative(1.0))
        };
        self.hidden.dot(&solution.beta) + &solution.intercept
    }
}

/// The matrix with its columns repeated.
pub(crate) fn doubled_columns<A: Scalar>(matrix: &Array2<A>) -> Array2<A> {
    concatenate(Axis(1), &[matrix.view(), matrix.view()]).unwrap()
}

/// The matrix with its rows repeated.
pub(crate) fn doubled_rows<A: Scalar>(matrix: &Array2<A>) -> Array2<A> {
    concatenate(Axis(0), &[matrix.view(), matrix.view()]).unwrap()
}

/// Problems in which something is out of the ordinary.
pub(crate) fn problems<A: Scalar>() -> Vec<(&'static str, Problem<A>)> {
    let tall = || normal::<A>(40, 8, 1);
    let plain = || Problem::noisy(tall(), 2, 1.0, 2);
    let mut sparse = weights::<A>(40, 3);
    sparse[5] = A::zero();
    sparse[17] = A::zero();
    // One neuron that only row 3 sees: without that row its weight is 0.
    let mut own = tall();
    own.column_mut(2).fill(A::zero());
    own[[3, 2]] = A::one();
    vec![
        ("plain", plain()),
        ("intercept", plain().with_intercept()),
        ("weights", plain().weighted(weights(40, 3))),
        (
            "weights, some 0, intercept",
            plain().weighted(sparse).with_intercept(),
        ),
        ("wide", Problem::noisy(normal(12, 30, 4), 2, 1.0, 5)),
        (
            "wide, intercept",
            Problem::noisy(normal(12, 30, 4), 2, 1.0, 5).with_intercept(),
        ),
        ("square", Problem::noisy(normal(15, 15, 6), 2, 1.0, 7)),
        (
            "square, intercept",
            Problem::noisy(normal(15, 15, 6), 2, 1.0, 7).with_intercept(),
        ),
        (
            "one row fewer than neurons",
            Problem::noisy(normal(15, 14, 6), 2, 1.0, 7).with_intercept(),
        ),
        (
            "rank-deficient",
            Problem::noisy(deficient(40, 12, 5, 8), 2, 5.0, 9),
        ),
        (
            "rank-deficient, intercept",
            Problem::noisy(deficient(40, 12, 5, 8), 2, 5.0, 9).with_intercept(),
        ),
        (
            "duplicated columns",
            Problem::noisy(doubled_columns(&tall()), 2, 1.0, 10).with_intercept(),
        ),
        (
            "duplicated rows",
            Problem::noisy(doubled_rows(&tall()), 2, 1.0, 11).with_intercept(),
        ),
        (
            "a row with a neuron of its own",
            Problem::noisy(own, 2, 1.0, 12).with_intercept(),
        ),
        (
            "only a constant",
            Problem::new(Array2::ones((9, 3)), normal(9, 2, 13)).with_intercept(),
        ),
        ("one row", Problem::new(normal(1, 3, 14), normal(1, 2, 15))),
    ]
}

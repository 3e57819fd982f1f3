//! A least-squares problem in the coordinates of its singular vectors, which is where every
//! solver but [`Inverse`](super::Inverse) works.
//!
//! With $\tilde H = U \operatorname{diag}(s) V^T$ (rows weighted, columns centred for the
//! intercept, everything scaled by powers of two into the middle of the floating-point range) and
//! $C = U^T \tilde T$, a solver is a choice of what each direction keeps: $\beta = V
//! \operatorname{diag}(g) C$ with $g_j = s_j / (s_j^2 + \lambda)$ for ridge, and $1 / s_j$ or 0
//! for the pseudo-inverse.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, Zip, s};

use super::{Diagnosis, LeastSquares, Route, Solution};
use crate::error::Result;
use crate::linalg::{Svd, Triangular};
use crate::scalar::Scalar;

/// See the module's documentation.
#[derive(Debug, Clone)]
pub(crate) struct Spectrum<A: Scalar> {
    pub(crate) route: Route,
    /// The singular values above rounding error, falling; length $k$.
    pub(crate) s: Array1<A>,
    /// Shape ($k$, neurons).
    vt: Array2<A>,
    /// $U^T \tilde T$, shape ($k$, outputs).
    pub(crate) c: Array2<A>,
    /// For each output the sum of squares of $\tilde T$ that no singular vector reaches.
    pub(crate) unreached: Array1<A>,
    frame: Frame<A>,
}

/// A [`Spectrum`] that also knows the rows, as leave-one-out needs them.
#[derive(Debug, Clone)]
pub(crate) struct RowSpectrum<A: Scalar> {
    pub(crate) spectrum: Spectrum<A>,
    /// Shape (rows, $k$).
    pub(crate) u: Array2<A>,
    /// $\tilde T - U C$: the residual where nothing is held back, shape (rows, outputs).
    pub(crate) residual: Array2<A>,
    /// Share of each row's leverage that lies outside the span of $U$ and the intercept:
    /// $1 - w_i / \sum w - \sum_j U_{ij}^2$, exactly 0 where $U$ spans everything.
    pub(crate) free: Array1<A>,
}

/// What was done to the problem before it was factorised, to be undone on the answer.
#[derive(Debug, Clone)]
struct Frame<A: Scalar> {
    rows: usize,
    /// Rows whose weight is not 0.
    weighted_rows: usize,
    intercept: bool,
    /// The largest row weight, which the others were divided by.
    weight_scale: A,
    /// The sum of the weights after that.
    total_weight: A,
    hidden_mean: Array1<A>,
    target_mean: Array1<A>,
    /// Powers of two that the matrices were divided by.
    hidden_scale: A,
    target_scale: Array1<A>,
}

/// The weighted, centred, scaled problem.
struct Prepared<A: Scalar> {
    hidden: Array2<A>,
    targets: Array2<A>,
    /// $w_i / \sum w$ with an intercept, else 0: its share of each row's leverage.
    intercept_leverage: Array1<A>,
    frame: Frame<A>,
}

impl<A: Scalar> Spectrum<A> {
    /// Factorises without keeping the rows.
    pub(crate) fn new(problem: &LeastSquares<'_, A>) -> Result<Self> {
        let Prepared {
            hidden,
            targets,
            frame,
            ..
        } = prepare(problem);
        // Below twice as many rows as columns QR first costs more than it saves.
        if hidden.nrows() >= 2 * hidden.ncols() {
            let Triangular { r, qtb, unreached } = A::triangularise(hidden.view(), targets.view())?;
            let Svd { u, s, vt } = truncate(A::svd(r.view())?, frame.rows);
            let c = A::product(u.t(), qtb.view());
            let dropped = squares(qtb.view()) - squares(c.view());
            let unreached = unreached + dropped.mapv(|d| d.max(A::zero()));
            return Ok(Self {
                route: Route::QrSvd,
                s,
                vt,
                c,
                unreached,
                frame,
            });
        }
        Ok(RowSpectrum::from_prepared(hidden, targets, None, frame)?.spectrum)
    }

    /// The number of singular values above `cutoff` times the largest.
    pub(crate) fn rank(&self, cutoff: A) -> usize {
        let Some(&largest) = self.s.first() else {
            return 0;
        };
        self.s
            .iter()
            .filter(|s| **s > A::zero() && **s > cutoff * largest)
            .count()
    }

    /// The answer for `gain` (shape ($k$, outputs), or ($k$, 1) for all): $\beta$ and intercept
    /// in the problem's own units, with a diagnosis of it.
    pub(crate) fn solution(
        &self,
        gain: &Array2<A>,
        cutoff: A,
        lambda: Vec<f64>,
        leave_one_out: Option<Vec<f64>>,
    ) -> Solution<A> {
        let outputs = self.c.ncols();
        let mut beta = A::product(self.vt.t(), (gain * &self.c).view());
        for (mut column, &scale) in beta.columns_mut().into_iter().zip(&self.frame.target_scale) {
            // Dividing first could overflow where the quotient does not.
            column.mapv_inplace(|b| b * (scale / self.frame.hidden_scale));
        }
        let intercept = &self.frame.target_mean - &self.frame.hidden_mean.dot(&beta);

        // The share of each direction that the fit keeps.
        let kept = gain * &self.s.view().insert_axis(Axis(1));
        let kept = |output: usize| kept.column(output.min(kept.ncols() - 1));
        let constant = f64::from(u8::from(self.frame.intercept));
        let residual_norm = (0..outputs).map(|o| {
            let left = Zip::from(kept(o))
                .and(self.c.column(o))
                .fold(A::zero(), |sum, &f, &c| sum + ((A::one() - f) * c).powi(2));
            (left + self.unreached[o]).sqrt().as_f64() * self.frame.target_scale[o].as_f64()
        });
        let rank = self.rank(cutoff);
        let root_weight = self.frame.weight_scale.as_f64().sqrt();
        let scale = self.frame.hidden_scale.as_f64() * root_weight;
        let singular_value = |i: usize| self.s.get(i).map_or(0.0, |s| s.as_f64() * scale);
        let (largest, smallest) = (singular_value(0), singular_value(rank.max(1) - 1));
        let diagnosis = Diagnosis {
            route: self.route,
            rank,
            condition: if rank == 0 { 1.0 } else { largest / smallest },
            largest_singular_value: largest,
            smallest_singular_value: smallest,
            lambda,
            degrees_of_freedom: (0..outputs)
                .map(|o| kept(o).sum().as_f64() + constant)
                .collect(),
            residual_norm: residual_norm.map(|norm| norm * root_weight).collect(),
            beta_norm: beta.columns().into_iter().map(norm).collect(),
            leave_one_out,
        };
        Solution {
            beta,
            intercept,
            diagnosis,
        }
    }

    /// Ridge's gain $s_j / (s_j^2 + \lambda s_1^2)$ for each output's relative $\lambda$.
    pub(crate) fn ridge_gain(&self, lambda: &[A]) -> Array2<A> {
        let largest = self.s.first().copied().unwrap_or(A::zero());
        Array2::from_shape_fn((self.s.len(), lambda.len()), |(j, o)| {
            let s = self.s[j];
            if s == A::zero() {
                A::zero()
            } else {
                s / (s * s + lambda[o] * largest * largest)
            }
        })
    }

    /// What ridge holds back of each direction, $\lambda s_1^2 / (s_j^2 + \lambda s_1^2)$,
    /// computed without subtracting from 1.
    pub(crate) fn ridge_held_back(&self, lambda: A) -> Array1<A> {
        let largest = self.s.first().copied().unwrap_or(A::zero());
        let absolute = lambda * largest * largest;
        self.s.mapv(|s| {
            if s == A::zero() {
                A::one()
            } else {
                absolute / (s * s + absolute)
            }
        })
    }

    /// Weighted rows that neither the singular vectors nor the intercept account for.
    pub(crate) fn spare_rows(&self) -> usize {
        let used = self.s.len() + usize::from(self.frame.intercept);
        self.frame.weighted_rows.saturating_sub(used)
    }

    /// The sum of the row weights, the largest being 1.
    pub(crate) fn total_weight(&self) -> f64 {
        self.frame.total_weight.as_f64()
    }

    /// What each output was divided by.
    pub(crate) fn target_scale(&self) -> ArrayView1<'_, A> {
        self.frame.target_scale.view()
    }
}

impl<A: Scalar> RowSpectrum<A> {
    /// Factorises and keeps the rows.
    pub(crate) fn new(problem: &LeastSquares<'_, A>) -> Result<Self> {
        let Prepared {
            hidden,
            targets,
            intercept_leverage,
            frame,
        } = prepare(problem);
        Self::from_prepared(hidden, targets, Some(intercept_leverage), frame)
    }

    fn from_prepared(
        hidden: Array2<A>,
        targets: Array2<A>,
        intercept_leverage: Option<Array1<A>>,
        frame: Frame<A>,
    ) -> Result<Self> {
        let Svd { u, s, vt } = truncate(A::svd(hidden.view())?, frame.rows);
        let c = A::product(u.t(), targets.view());
        let mut residual = targets - A::product(u.view(), c.view());
        // U spans every row, or every row but the intercept's: what is left is rounding, and
        // leave-one-out would divide one rounding error by another.
        let spanned = u.ncols() + usize::from(frame.intercept) >= frame.weighted_rows;
        if spanned {
            residual.fill(A::zero());
        }
        let mut free = Array1::zeros(u.nrows());
        if let Some(leverage) = intercept_leverage {
            Zip::from(&mut free)
                .and(u.rows())
                .and(&leverage)
                .for_each(|free, row, &constant| {
                    let own = row.dot(&row);
                    let weightless = own == A::zero() && constant == A::zero();
                    if weightless || !spanned {
                        *free = (A::one() - constant - own).max(A::zero());
                    }
                });
        }
        let unreached = squares(residual.view());
        let spectrum = Spectrum {
            route: Route::Svd,
            s,
            vt,
            c,
            unreached,
            frame,
        };
        Ok(Self {
            spectrum,
            u,
            residual,
            free,
        })
    }
}

/// The level below which a singular value of a matrix of this size is rounding error, relative to
/// the largest one.
pub(crate) fn rounding<A: Scalar>(rows: usize, columns: usize) -> A {
    // The backward error of the factorisations grows like the root of the size in practice; the
    // usual bound eps * max(rows, columns) would cut at 0.01 for 100,000 rows of f32.
    A::epsilon() * A::from_f64(4.0 * (rows.max(columns) as f64).sqrt())
}

/// Drops the directions whose singular values are rounding error. Their left singular vectors are
/// arbitrary, and may lean into the direction of the intercept or of the true residual.
fn truncate<A: Scalar>(svd: Svd<A>, rows: usize) -> Svd<A> {
    let cutoff = rounding::<A>(rows, svd.vt.ncols()) * svd.s.first().copied().unwrap_or(A::zero());
    let rank = svd.s.iter().filter(|s| **s > cutoff).count();
    if rank == svd.s.len() {
        return svd;
    }
    Svd {
        u: svd.u.slice(s![.., ..rank]).to_owned(),
        s: svd.s.slice(s![..rank]).to_owned(),
        vt: svd.vt.slice(s![..rank, ..]).to_owned(),
    }
}

/// Sum of squares of each column.
fn squares<A: Scalar>(matrix: ArrayView2<'_, A>) -> Array1<A> {
    matrix.map_axis(Axis(0), |column| column.dot(&column))
}

fn prepare<A: Scalar>(problem: &LeastSquares<'_, A>) -> Prepared<A> {
    let rows = problem.rows();
    let hidden_scale = power_of_two(problem.hidden.iter());
    let target_scale: Array1<A> = problem
        .targets
        .columns()
        .into_iter()
        .map(|column| power_of_two(column.iter()))
        .collect();
    let mut hidden = problem.hidden.mapv(|h| h / hidden_scale);
    let mut targets = &problem.targets / &target_scale;

    // Largest weight 1, so that 1e300 and 1e-300 are as good as 1.
    let weight_scale = problem.weights.map_or(A::one(), |weights| {
        weights.iter().fold(A::zero(), |m, w| m.max(*w))
    });
    let weights = problem
        .weights
        .map(|weights| weights.mapv(|w| w / weight_scale));
    let total = weights
        .as_ref()
        .map_or(A::from_f64(rows as f64), |w| w.sum());
    let mean = |matrix: &Array2<A>| match &weights {
        Some(weights) => weights.dot(matrix) / total,
        None => matrix.sum_axis(Axis(0)) / total,
    };
    let mut intercept_leverage = Array1::zeros(rows);
    let (mut hidden_mean, mut target_mean) = (
        Array1::zeros(hidden.ncols()),
        Array1::zeros(targets.ncols()),
    );
    if problem.intercept {
        hidden_mean = mean(&hidden);
        target_mean = mean(&targets);
        hidden -= &hidden_mean;
        targets -= &target_mean;
        intercept_leverage.fill(A::one() / total);
        if let Some(weights) = &weights {
            intercept_leverage *= weights;
        }
    }
    if let Some(weights) = &weights {
        let roots = weights.mapv(A::sqrt).insert_axis(Axis(1));
        hidden *= &roots;
        targets *= &roots;
    }
    hidden_mean.mapv_inplace(|m| m * hidden_scale);
    target_mean *= &target_scale;
    let weighted_rows = weights.as_ref().map_or(rows, |weights| {
        weights.iter().filter(|w| **w > A::zero()).count()
    });
    let frame = Frame {
        rows,
        weighted_rows,
        intercept: problem.intercept,
        weight_scale,
        total_weight: total,
        hidden_mean,
        target_mean,
        hidden_scale,
        target_scale,
    };
    Prepared {
        hidden,
        targets,
        intercept_leverage,
        frame,
    }
}

/// The power of two just above the largest magnitude (so dividing by it rounds nothing), or 1 for
/// all zeros.
fn power_of_two<'a, A: Scalar>(values: impl Iterator<Item = &'a A>) -> A {
    let largest = values.fold(A::zero(), |m, v| m.max(v.abs()));
    if largest == A::zero() {
        return A::one();
    }
    // log2 of a subnormal is fine; 2^1024 is not, hence the bounds of a normal power.
    let lowest = A::min_positive_value().log2();
    let exponent = largest.log2().floor().max(lowest).min(-lowest - A::one());
    A::from_f64(2.0).powf(exponent)
}

fn norm<A: Scalar>(column: ArrayView1<'_, A>) -> f64 {
    let largest = column.iter().fold(0.0_f64, |m, v| m.max(v.as_f64().abs()));
    if largest == 0.0 {
        return 0.0;
    }
    largest
        * column
            .iter()
            .map(|v| (v.as_f64() / largest).powi(2))
            .sum::<f64>()
            .sqrt()
}

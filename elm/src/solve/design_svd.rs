//! A least-squares problem in the coordinates of its singular vectors, which is where every
//! solver but [`Inverse`](super::Inverse) works.
//!
//! With $\tilde H = U \operatorname{diag}(s) V^T$ (rows weighted, columns centered for the
//! intercept, everything scaled by powers of two into the middle of the floating-point range) and
//! $C = U^T \tilde T$, a solver is a choice of what each direction keeps: $\beta = V
//! \operatorname{diag}(g) C$ with $g_j = s_j / (s_j^2 + \lambda)$ for ridge, and $1 / s_j$ or 0
//! for the pseudo-inverse.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, Zip, s};

use super::equilibration::{EquilibratedProblem, Equilibration};
use super::norms::{norm, rounding};
use super::{Diagnosis, LeastSquares, Reason, Route, Solution};
use crate::error::Result;
use crate::linalg::{QrFactor, Svd};
use crate::scalar::Scalar;

/// See the module's documentation.
#[derive(Debug, Clone)]
pub(crate) struct DesignSvd<A: Scalar> {
    pub(crate) route: Route,
    /// The singular values above rounding error, falling; length $k$.
    pub(crate) s: Array1<A>,
    /// Shape ($k$, neurons).
    pub(crate) vt: Array2<A>,
    /// $U^T \tilde T$, shape ($k$, outputs).
    pub(crate) c: Array2<A>,
    /// For each output the sum of squares of $\tilde T$ that no singular vector reaches.
    pub(crate) residual_ss: Array1<A>,
    /// The sum of squares of each column as predictions see it: scaled but not centered.
    pub(crate) column_ss: Array1<A>,
    /// The weakest relative strength of ridge that this serves; nothing where it serves all. Sums of products
    /// of a bad condition have no digits of directions that weaker ones do not hold back.
    pub(crate) weakest: Option<f64>,
    pub(crate) frame: Equilibration<A>,
}

/// A [`DesignSvd`] that also knows the rows, as leave-one-out needs them.
#[derive(Debug, Clone)]
pub(crate) struct DesignSvdWithRows<A: Scalar> {
    pub(crate) spectrum: DesignSvd<A>,
    /// Shape (rows, $k$).
    pub(crate) u: Array2<A>,
    /// $\tilde T - U C$: the residual where nothing is held back, shape (rows, outputs).
    pub(crate) residual: Array2<A>,
    /// Share of each row's leverage that lies outside the span of $U$ and the intercept:
    /// $1 - w_i / \sum w - \sum_j U_{ij}^2$, exactly 0 where they span everything (1 for a row of
    /// weight 0).
    pub(crate) one_minus_leverage: Array1<A>,
    /// The unit vector of the intercept; 0 without one.
    pub(crate) constant: Array1<A>,
    /// Rows whose residual is a difference, and what rounding may make of it for each output.
    pub(super) doubtful: Vec<(usize, Vec<A>)>,
}

impl<A: Scalar> DesignSvd<A> {
    /// Factorizes without keeping the rows.
    pub(crate) fn new(problem: &LeastSquares<'_, A>) -> Result<Self> {
        Self::from_prepared(EquilibratedProblem::new(problem))
    }

    /// As [`new`](Self::new), for a problem that is prepared already.
    pub(crate) fn from_prepared(prepared: EquilibratedProblem<A>) -> Result<Self> {
        let EquilibratedProblem {
            hidden,
            targets,
            frame,
        } = prepared;
        if Self::goes_by_triangle(hidden.view()) {
            let triangle = A::triangularize(hidden.view(), targets.view())?;
            return Self::of_triangle(triangle, frame);
        }
        let none = Array1::zeros(targets.ncols());
        Self::decompose(Route::Svd, hidden.view(), targets, none, frame)
    }

    /// Whether a matrix is triangularized before its singular values are taken. Below twice as many
    /// rows as columns that costs more than it saves, and what it leaves in directions that are not
    /// there is no longer small beside [`rounding`].
    pub(crate) fn goes_by_triangle(hidden: ArrayView2<'_, A>) -> bool {
        hidden.nrows() >= 2 * hidden.ncols()
    }

    /// For a problem that a QR factorization has reduced to its triangle.
    pub(crate) fn of_triangle(triangle: QrFactor<A>, frame: Equilibration<A>) -> Result<Self> {
        let QrFactor {
            r,
            qtb,
            residual_ss,
        } = triangle;
        Self::decompose(Route::QrSvd, r.view(), qtb, residual_ss, frame)
    }

    /// `residual_ss`: per output, the residual sum of squares outside the column space, which is
    /// already removed from `targets`.
    fn decompose(
        route: Route,
        hidden: ArrayView2<'_, A>,
        targets: Array2<A>,
        mut residual_ss: Array1<A>,
        frame: Equilibration<A>,
    ) -> Result<Self> {
        let column_ss = frame.column_ss(hidden);
        let Svd { u, s, vt } = truncate(A::svd(hidden)?, frame.weighted_rows);
        let c = A::product(u.t(), targets.view());
        if frame.spanned_by(s.len()) {
            residual_ss.fill(A::zero());
        } else {
            let residual = targets - A::product(u.view(), c.view());
            residual_ss += &squares(residual.view());
        }
        Ok(Self {
            route,
            s,
            vt,
            c,
            residual_ss,
            column_ss,
            weakest: None,
            frame,
        })
    }

    /// The level of rounding error in singular values, relative to the largest.
    pub(crate) fn level(&self) -> A {
        rounding(self.frame.weighted_rows, self.vt.ncols())
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
        reason: Reason,
        lambda: Vec<f64>,
        leave_one_out: Option<Vec<f64>>,
    ) -> Solution<A> {
        let outputs = self.c.ncols();
        let beta = self
            .frame
            .unscale(A::product(self.vt.t(), (gain * &self.c).view()));
        let intercept = self.frame.constant(&beta);

        // The share of each direction that the fit keeps.
        let kept = gain * &self.s.view().insert_axis(Axis(1));
        let kept = |output: usize| kept.column(output.min(kept.ncols() - 1));
        let constant = f64::from(u8::from(self.frame.intercept));
        let residual_norms = (0..outputs).map(|o| {
            let left = Zip::from(kept(o))
                .and(self.c.column(o))
                .fold(A::zero(), |sum, &f, &c| sum + ((A::one() - f) * c).powi(2));
            (left + self.residual_ss[o]).sqrt().as_f64()
        });
        let rank = self.rank(cutoff);
        let singular_value = |i: usize| {
            self.s
                .get(i)
                .map_or(0.0, |&s| self.frame.singular_value_in_original_units(s))
        };
        let (largest, smallest) = (singular_value(0), singular_value(rank.max(1) - 1));
        let condition = if rank == 0 { 1.0 } else { largest / smallest };
        let known = self.weakest.is_none();
        let diagnosis = Diagnosis {
            route: self.route,
            reason,
            rank: known.then_some(rank),
            condition: known.then_some(condition),
            largest_singular_value: largest,
            smallest_singular_value: known.then_some(smallest),
            lambda,
            degrees_of_freedom: (0..outputs)
                .map(|o| kept(o).sum().as_f64() + constant)
                .collect(),
            residual_norm: self.frame.residual_norms_in_original_units(residual_norms),
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
        let mut gain = Array2::zeros((self.s.len(), lambda.len()));
        for (mut column, &lambda) in gain.columns_mut().into_iter().zip(lambda) {
            column.assign(&(self.filter_factors(lambda) / &self.s));
        }
        gain
    }

    /// What ridge keeps of each direction, $s_j^2 / (s_j^2 + \lambda s_1^2)$.
    pub(crate) fn filter_factors(&self, lambda: A) -> Array1<A> {
        self.s.mapv(|s| share((s / self.s[0]).powi(2), lambda))
    }

    /// What ridge holds back of each direction, $\lambda s_1^2 / (s_j^2 + \lambda s_1^2)$:
    /// nothing at $\lambda = 0$, all at infinity.
    pub(crate) fn filter_complements(&self, lambda: A) -> Array1<A> {
        self.s.mapv(|s| share(lambda, (s / self.s[0]).powi(2)))
    }

    /// For each output the squared error that rounding leaves in the predictions of all rows, in
    /// units of the scaled targets, when each direction keeps this share and arithmetic has this
    /// unit roundoff $u$: $u^2 \sum_k \lVert h_k \rVert^2 \beta_k^2$, each product being off by $u$ of
    /// itself. Where that is below `negligible` the result is 0.
    pub(crate) fn rounding_squares(
        &self,
        kept: &Array1<A>,
        roundoff: f64,
        negligible: impl Fn(usize) -> f64,
    ) -> Vec<f64> {
        let gain = (kept / &self.s).insert_axis(Axis(1));
        let along = &self.c * &gain;
        let squared = roundoff * roundoff;
        let longest = self
            .column_ss
            .iter()
            .fold(0.0, |m: f64, l| m.max(l.as_f64()));
        let matters: Vec<usize> = (0..along.ncols())
            .filter(|&output| {
                let column = along.column(output);
                squared * longest * column.dot(&column).as_f64() > negligible(output)
            })
            .collect();
        let mut errors = vec![0.0; along.ncols()];
        let beta = A::product(self.vt.t(), along.select(Axis(1), &matters).view());
        for (&output, beta) in matters.iter().zip(beta.columns()) {
            let sum = Zip::from(beta)
                .and(&self.column_ss)
                .fold(A::zero(), |sum, &b, &length| sum + b * b * length);
            errors[output] = squared * sum.as_f64();
        }
        errors
    }

    /// The largest singular value over the smallest, 1 without any.
    pub(crate) fn condition(&self) -> f64 {
        match (self.s.first(), self.s.last()) {
            (Some(first), Some(last)) => first.as_f64() / last.as_f64(),
            _ => 1.0,
        }
    }

    /// Weighted rows that neither the singular vectors nor the intercept account for.
    pub(crate) fn spare_rows(&self) -> usize {
        let used = self.s.len() + usize::from(self.frame.intercept);
        self.frame.weighted_rows.saturating_sub(used)
    }

    /// Whether leave-one-out exists: an intercept needs another row.
    pub(crate) fn can_lose_a_row(&self) -> bool {
        self.frame.weighted_rows > usize::from(self.frame.intercept)
    }

    /// For each output the sum of squares of $\tilde T$.
    pub(crate) fn total_squares(&self) -> Array1<A> {
        squares(self.c.view()) + &self.residual_ss
    }

    /// The means of hidden values and targets, in units of their scale.
    pub(super) fn means(&self) -> Vec<A> {
        let hidden = &self.frame.hidden_mean / self.frame.hidden_scale;
        let targets = &self.frame.target_mean / &self.frame.target_scale;
        hidden.iter().chain(&targets).copied().collect()
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

impl<A: Scalar> DesignSvdWithRows<A> {
    /// Factorizes and keeps the rows.
    pub(crate) fn new(problem: &LeastSquares<'_, A>) -> Result<Self> {
        let EquilibratedProblem {
            hidden,
            targets,
            frame,
        } = EquilibratedProblem::new(problem);
        let constant = frame.constant_direction();
        // A row of weight 0 has no residual, which must not be divided by 0.
        let absent = |root: A| {
            if root > A::zero() {
                A::zero()
            } else {
                A::one()
            }
        };
        let absent = frame.root_weights.mapv(absent);
        Self::of_rows(hidden, targets, constant, absent, frame)
    }

    /// Of rows that are weighted and centered, with the unit vector of the intercept among them (0
    /// without one) and a 1 for those that are absent. There may be fewer than the frame's, which
    /// others stand for.
    pub(crate) fn of_rows(
        hidden: Array2<A>,
        targets: Array2<A>,
        constant: Array1<A>,
        absent: Array1<A>,
        frame: Equilibration<A>,
    ) -> Result<Self> {
        let column_ss = frame.column_ss(hidden.view());
        let Svd { u, s, vt } = truncate(A::svd(hidden.view())?, frame.weighted_rows);
        let c = A::product(u.t(), targets.view());
        let spanned = frame.spanned_by(u.ncols());
        let mut rows = Self {
            one_minus_leverage: absent,
            residual: Array2::zeros(targets.dim()),
            spectrum: DesignSvd {
                route: Route::Svd,
                s,
                vt,
                residual_ss: Array1::zeros(targets.ncols()),
                c,
                column_ss,
                weakest: None,
                frame,
            },
            constant,
            doubtful: Vec::new(),
            u,
        };
        if !spanned {
            rows.residual = rows.off_span(targets.clone());
            rows.measure_freedom(targets.view());
            rows.spectrum.residual_ss = squares(rows.residual.view());
        }
        Ok(rows)
    }

    /// The part of each column (one entry per row of the problem) that is orthogonal to $U$ and
    /// to the intercept. Twice, as the first pass leaves rounding errors of the size of what it
    /// took away (Parlett's "twice is enough").
    pub(crate) fn off_span(&self, mut columns: Array2<A>) -> Array2<A> {
        let constant = self.constant.view().insert_axis(Axis(1));
        for _ in 0..2 {
            let shares = A::product(self.u.t(), columns.view());
            columns -= &A::product(self.u.view(), shares.view());
            let shares = A::product(constant.t(), columns.view());
            columns -= &A::product(constant, shares.view());
        }
        columns
    }

    /// Fills [`one_minus_leverage`](Self::one_minus_leverage), and mends [`residual`](Self::residual) where
    /// it is small because the row determines its own fit.
    fn measure_freedom(&mut self, targets: ArrayView2<'_, A>) {
        let u = &self.u;
        self.one_minus_leverage = Array1::from_shape_fn(u.nrows(), |i| {
            A::one() - self.constant[i].powi(2) - u.row(i).dot(&u.row(i))
        });
        // The subtraction above has an error of epsilon. Where its result is small, take the
        // squared norm of the part of the row's unit vector that is left over instead: its error
        // is epsilon times its root. There are at most about `neurons` such rows.
        let coarse = A::epsilon().sqrt().sqrt();
        let close: Vec<usize> = (0..u.nrows())
            .filter(|&i| self.one_minus_leverage[i] < coarse)
            .collect();
        let noise = self.spectrum.level();
        for block in close.chunks(64) {
            let mut units = Array2::zeros((u.nrows(), block.len()));
            for (column, &row) in block.iter().enumerate() {
                units[[row, column]] = A::one();
            }
            let left = self.off_span(units);
            let mut mended = A::product(left.t(), self.residual.view());
            for (column, &row) in block.iter().enumerate() {
                let own = left.column(column);
                let own = own.dot(&own);
                let alone = own.sqrt() <= noise;
                self.one_minus_leverage[row] = if alone { A::zero() } else { own };
                if alone {
                    mended.row_mut(column).fill(A::zero());
                }
                let difference: Vec<_> = self.difference(row, targets.row(row)).collect();
                let mut own = self.residual.row_mut(row);
                own.assign(&mended.row(column));
                // More than rounding: errors of the row's coordinates in weak directions, which a strength
                // holds back. They cancel in the difference.
                if own
                    .iter()
                    .zip(&difference)
                    .any(|(own, (raw, rounding))| (*raw - *own).abs() > *rounding)
                {
                    own.iter_mut()
                        .zip(&difference)
                        .for_each(|(own, (raw, _))| *own = *raw);
                    let rounding = difference.into_iter().map(|(_, rounding)| rounding);
                    self.doubtful.push((row, rounding.collect()));
                }
            }
        }
    }

    /// The targets of a row less their part in the span, and what rounding may make of that difference.
    fn difference<'a>(
        &'a self,
        row: usize,
        targets: ArrayView1<'a, A>,
    ) -> impl Iterator<Item = (A, A)> + 'a {
        let u = self.u.row(row);
        let columns = self.spectrum.c.columns().into_iter();
        columns.zip(targets).map(move |(c, &target)| {
            let mut size = target.abs();
            let mut left = target;
            for (&u, &c) in u.iter().zip(c) {
                left -= u * c;
                size += (u * c).abs();
            }
            (left, size * self.spectrum.level())
        })
    }
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

/// $a / (a + b)$ for numbers that are not negative nor both 0, without leaving the range and
/// without subtracting, so that a small share keeps its digits.
fn share<A: Scalar>(a: A, b: A) -> A {
    if a < b {
        let ratio = a / b;
        ratio / (A::one() + ratio)
    } else {
        (A::one() + b / a).recip()
    }
}

/// Sum of squares of each column.
fn squares<A: Scalar>(matrix: ArrayView2<'_, A>) -> Array1<A> {
    matrix.map_axis(Axis(0), |column| column.dot(&column))
}

//! Jackknife+ intervals (Barber, Candes, Ramdas and Tibshirani, 2021) without a refit.

use ndarray::{Array, Array1, Array2, Zip, s};

use super::UncertainElm;
use super::compact::{EDGES, rows_outside};
use crate::dataset::{Inputs, TargetDim};
use crate::error::Result;
use crate::scalar::Scalar;

impl<A: Scalar, D: TargetDim> UncertainElm<A, D> {
    /// Lower and upper ends of jackknife+ intervals that cover a new observation with about this
    /// probability: shape (rows, inputs) to two of (rows, outputs). With too few training rows
    /// for the coverage asked for (fewer than $1 / (1 - \text{coverage}) - 1$) they are infinite;
    /// for one below a half the lower end may lie above the upper: the interval is empty.
    ///
    /// Costs training rows x neurons for each row of `x`.
    ///
    /// # Errors
    /// [`Error::Parameter`](crate::Error::Parameter) unless `coverage` lies strictly between 0 and 1; those
    /// of [`Elm::predict`](crate::Elm::predict).
    pub fn predict_interval<X: Inputs<A> + ?Sized>(
        &self,
        x: &X,
        coverage: f64,
    ) -> Result<(Array<A, D>, Array<A, D>)> {
        let rows = self.rows.present.len();
        let outside = rows_outside(coverage, rows)?;
        let x = x.as_matrix();
        let predicted = self.model().predict_matrix(&x)?;
        let hidden = self.members().map(|member| member.hidden_matrix(&x));
        let hidden = hidden.collect::<Result<Vec<_>>>()?;
        let mut low = Array2::from_elem(predicted.dim(), A::neg_infinity());
        let mut high = Array2::from_elem(predicted.dim(), A::infinity());
        if outside == 0 {
            return Ok((D::of_matrix(low), D::of_matrix(high)));
        }
        let change = self.compact.change_outside(&x);
        let variance = if self.compact.is_studentized {
            self.compact.variance_of(&hidden)
        } else {
            Array2::ones(predicted.dim())
        };
        let mut ends = vec![A::zero(); rows];
        for (output, scores) in self.scores.columns().into_iter().enumerate() {
            for row in 0..x.nrows() {
                let (moves, mut halves) =
                    self.without_each_row(&hidden, (row, output), variance[[row, output]]);
                halves.mapv_inplace(A::sqrt);
                halves *= &scores;
                let center = predicted[[row, output]];
                let wider = A::from_f64(EDGES) * change[[row, output]];
                let mut end = |sign: A| {
                    for (end, &counted) in ends.iter_mut().zip(&self.rows.present) {
                        *end = sign * (center - moves[counted]) - halves[counted];
                    }
                    let (_, value, _) = ends.select_nth_unstable_by(outside - 1, |a, b| {
                        a.as_f64().total_cmp(&b.as_f64())
                    });
                    sign * (*value - wider)
                };
                low[[row, output]] = end(A::one());
                high[[row, output]] = end(-A::one());
            }
        }
        Ok((D::of_matrix(low), D::of_matrix(high)))
    }

    /// How far a prediction (row, output) moves when each training row is left out, and its variance then.
    fn without_each_row(
        &self,
        hidden: &[Array2<A>],
        (row, output): (usize, usize),
        variance: A,
    ) -> (Array1<A>, Array1<A>) {
        let share = A::from_f64(self.members.len() as f64).recip();
        let rows = self.scores.nrows();
        let mut moves = Array1::zeros(rows);
        let mut variances = Array1::from_elem(rows, variance);
        let models = self.members.iter().zip(self.members());
        for ((member, model), hidden) in models.zip(hidden) {
            let lambda = model.diagnosis().lambda[output];
            let here = hidden.slice(s![row..=row, ..]);
            let pull = member.validator.influence(&here, lambda);
            Zip::from(&mut moves)
                .and(&pull)
                .and(member.residuals.column(output))
                .for_each(|moved, &pull, &left_out| *moved += share * pull * left_out);
            if self.compact.is_studentized {
                Zip::from(&mut variances)
                    .and(&pull)
                    .and(&self.rows.weights)
                    .and(member.freedom.column(output))
                    .for_each(|variance, &pull, &weight, &freedom| {
                        if weight > A::zero() {
                            *variance += share * pull * pull / (weight * freedom);
                        }
                    });
            }
        }
        self.rows.pool(&mut moves);
        (moves, variances)
    }
}

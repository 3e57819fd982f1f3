//! What predictions owe to each input, by held-out errors.

use ndarray::{Array2, Array3, Zip, s};
use rand::seq::SliceRandom;

use super::UncertainElm;
use crate::check::check_length;
use crate::cross_validation::Shifts;
use crate::dataset::{Dataset, TargetDim};
use crate::error::{Error, Result};
use crate::memory::check_room;
use crate::network::Elm;
use crate::scalar::Scalar;
use crate::stream::Stream;

impl<A: Scalar, D: TargetDim> UncertainElm<A, D> {
    /// By how much $R^2$ falls where the values of one input are those of other rows: the permutation
    /// importance of each input (Breiman, Random Forests, Machine Learning 45, 2001), of leave-one-out
    /// predictions, so that it needs no rows that were set aside. Shape (inputs, outputs, repeats); take the
    /// mean over repeats, and their spread for what chance does.
    ///
    /// `data` are the rows that were fitted to. Each row is predicted by the fit without it, exactly; rows
    /// of one group by the fit without the group. Of inputs that say the same neither is important, as the
    /// other is still there. 0 throughout for constant targets.
    ///
    /// Costs a hidden layer of all rows for each input and repeat, and once a product of rows, neurons and
    /// neurons.
    ///
    /// ```
    /// use elm::{Dataset, ElmParams};
    /// use ndarray::{Array2, Axis};
    ///
    /// let x = Array2::from_shape_fn((200, 2), |(i, j)| ((i * (3 + 4 * j)) % 101) as f64 / 50.0 - 1.0);
    /// let t = x.column(0).mapv(|x| (3.0 * x).sin());
    /// let data = Dataset::new(&x, &t)?;
    /// let model = ElmParams::new(40).fit_uncertain(&data)?;
    /// let falls = model.permutation_importance(&data, 5, 0)?;
    /// let mean = falls.mean_axis(Axis(2)).unwrap();
    /// assert!(mean[[0, 0]] > 1.0 && mean[[1, 0]].abs() < 0.1);
    /// # Ok::<(), elm::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Shape`] for rows, inputs or outputs of other numbers than were fitted to;
    /// [`Error::Parameter`] for 0 repeats; [`Error::TooLarge`]; those of [`Elm::predict`].
    #[doc(alias = "feature_importances_")]
    pub fn permutation_importance(
        &self,
        data: &Dataset<'_, A, D>,
        repeats: usize,
        seed: u64,
    ) -> Result<Array3<f64>> {
        let (x, t) = (data.inputs(), data.target_matrix());
        check_length("rows", x.nrows(), self.left_out.nrows())?;
        check_length("inputs", x.ncols(), self.model().inputs())?;
        check_length("outputs", t.ncols(), self.left_out.ncols())?;
        if repeats == 0 {
            return Err(Error::Parameter {
                name: "repeats",
                value: 0.0,
                expected: "at least 1",
            });
        }
        check_room(
            "the importances",
            x.ncols().saturating_mul(t.ncols()),
            repeats,
        )?;
        let labels = match &self.rows.groups {
            Some(groups) => groups.clone(),
            None => (0..x.nrows()).collect(),
        };
        let shifts = self.shifts(&labels)?;
        let squares = |errors: Array2<A>| self.rows.errors(errors.view()).mapv_into(|e| e * e);
        let held_out = squares(self.left_out.clone());
        let variance = squares(self.centered(t.to_owned()));
        let mut importances = Array3::zeros((x.ncols(), t.ncols(), repeats));
        let mut changed = x.to_owned();
        for input in 0..x.ncols() {
            let mut random = Stream::Permutations(input as u32).of(seed);
            for repeat in 0..repeats {
                let mut others = self.rows.present.clone();
                others.shuffle(&mut random);
                for (&row, &other) in self.rows.present.iter().zip(&others) {
                    changed[[row, input]] = x[[other, input]];
                }
                let predicted = self.without_own_rows(&changed, &shifts, &labels)?;
                Zip::from(importances.slice_mut(s![input, .., repeat]))
                    .and(&squares(&t - &predicted))
                    .and(&held_out)
                    .and(&variance)
                    .for_each(|fall, changed, held_out, &variance| {
                        if variance > 0.0 {
                            *fall = (changed - held_out) / variance;
                        }
                    });
            }
            changed.column_mut(input).assign(&x.column(input));
        }
        Ok(importances)
    }

    /// Of each member and output, what leaving out the rows of each label does.
    fn shifts(&self, labels: &[usize]) -> Result<Vec<Vec<Shifts<A>>>> {
        let members = self.members.iter().zip(self.members());
        let of_member = |(left_out, model): (&super::LeftOut<A>, &Elm<A, D>)| {
            let lambda = &model.diagnosis().lambda;
            check_room(
                "the influence of each row",
                labels.len(),
                model.beta().len(),
            )?;
            let columns = left_out.residuals.columns().into_iter().zip(lambda);
            let shifts = columns
                .map(|(residuals, &lambda)| left_out.validator.shifts(residuals, labels, lambda));
            Ok(shifts.collect())
        };
        members.map(of_member).collect()
    }

    /// What is predicted for each row by the fit without the rows of its label, shape (rows, outputs).
    fn without_own_rows(
        &self,
        x: &Array2<A>,
        shifts: &[Vec<Shifts<A>>],
        labels: &[usize],
    ) -> Result<Array2<A>> {
        let share = A::from_f64(self.members.len() as f64).recip();
        let mut predicted = self.model().predict_matrix(x)?;
        for (member, shifts) in self.members().zip(shifts) {
            let hidden = member.hidden_matrix(x)?;
            for (mut column, shifts) in predicted.columns_mut().into_iter().zip(shifts) {
                column.scaled_add(share, &shifts.of_rows(&hidden, labels));
            }
        }
        Ok(predicted)
    }

    /// Targets less their weighted mean.
    fn centered(&self, mut t: Array2<A>) -> Array2<A> {
        let rows = A::from_f64(self.rows.present.len() as f64);
        for mut column in t.columns_mut() {
            let mean = column.dot(&self.rows.weights) / rows;
            column -= mean;
        }
        t
    }
}

//! Standard deviations and intervals of predictions.
//!
//! Two answers, from the factorization that found the output weights:
//!
//! - [`UncertainElm::predict_deviation`]: the standard deviation of a new observation under the
//!   ridge posterior. With $\beta \sim N(0, \sigma^2 / \lambda)$ and noise $\sigma$ the variance at
//!   $x$ is $\sigma^2 (1 + 1/n + \tilde h(x)^T (\tilde H^T \tilde H + \lambda)^{-1} \tilde h(x))$,
//!   columns centered for the intercept (without one the $1/n$ goes too). $\sigma^2$ is estimated by
//!   the mean of residual times leave-one-out residual, which counts each squared residual by the
//!   freedom that its row kept. Cheap and smooth, right where noise is normal and even.
//! - [`UncertainElm::predict_interval`]: the jackknife+ of Barber, Candès, Ramdas and Tibshirani
//!   (Annals of Statistics 49(1), 2021), from exact leave-one-out residuals and the predictions of
//!   the $n$ networks that each leave out one row, all in closed form. Assumes nothing of the noise
//!   but that rows are exchangeable: of settings that were not chosen on the rows, an interval asked to
//!   cover $1 - \alpha$ covers at least $1 - 2\alpha$, and about $1 - \alpha$ in practice. Residuals are
//!   studentized: the one of row $i$ counts relative to the deviation above, at that row by the fit without
//!   it, and is scaled by the deviation of that fit at $x$. Intervals are therefore wider where the training
//!   rows say little. The guarantee holds for any such scale that treats all rows alike.
//!
//! Outside the training rows neither knows how the function goes on. Both then add what it may change
//! by between the edge of the data, where predictions are [held](crate::bounds), and the row: with
//! $e_j$ the distance beyond the range of input $j$ and $g_j$ the slope of the network along it, at
//! the edge or as a root mean square over the training rows, whichever is steeper,
//! $r = (\sum_j g_j^2 e_j^2)^{1/2}$ as one more independent deviation, and $6r$ at either end of an
//! interval. This assumes that the function is no steeper outside than inside; it is no guarantee.
//!
//! Of rows with weights, a row of weight $w$ is taken for an observation whose noise has the variance
//! $\sigma^2 / w$, and a new observation for one of the mean weight. Rows of one
//! [group](Dataset::with_groups) are left out together: the intervals are those of new groups, from the
//! groups' held-out errors (CV+ in the same paper, not studentized), and $\sigma^2$ is the mean square of
//! those.
//!
//! [`UncertainElm::permutation_importance`] says how much of the leave-one-out $R^2$ hangs on each input.
//!
//! [`UncertainElm::compact`] leaves the rows out: what remains fits in a file, has the same deviations, and
//! has the jackknife's intervals.
//!
//! Both take the random layer, its standardization and $\lambda$ as given. Where these were chosen on
//! the same rows, as $\lambda$ is by default and everything by [`ElmParams::auto`], nothing is
//! guaranteed: errors are larger than either says, a little with many rows, and by a half with ten. There
//! 90 % intervals cover 0.8 or more after a choice of $\lambda$ alone and about 0.75 after `auto`.
//!
//! ```
//! use elm::{Dataset, ElmParams};
//! use ndarray::{Array1, Axis, array};
//!
//! let x = Array1::linspace(-3.0, 3.0, 80).insert_axis(Axis(1));
//! let t = x.column(0).mapv(|x: f64| x.sin() + 0.05 * (37.0 * x).sin());
//! let model = ElmParams::new(20).fit_uncertain(&Dataset::new(&x, &t)?)?;
//! let deviation = model.predict_deviation(&array![[0.0], [30.0]])?;
//! assert!(deviation[0] < 0.1 && deviation[1] > deviation[0]);
//! let (low, high) = model.predict_interval(&array![[0.0]], 0.9)?;
//! assert!(low[0] < 0.0 && high[0] > 0.0);
//! # Ok::<(), elm::Error>(())
//! ```

mod compact;
mod counted_rows;
#[cfg(feature = "persist")]
mod files;
mod importance;
mod interval;

use ndarray::{Array, Array1, Array2, ArrayRef2, Axis, Ix2, Zip, s};

use crate::cross_validation::CrossValidator;
use crate::dataset::{Dataset, Inputs, TargetDim, per_output};
use crate::error::{Error, Result};
use crate::feature_map::FeatureMap;
use crate::model::ElmParams;
use crate::network::Elm;
use crate::scalar::Scalar;
use crate::solve::Solver;
use crate::stats;
pub use compact::CompactUncertainElm;
use compact::{Member, finite};
use counted_rows::CountedRows;

/// A fitted network that knows how far off it may be; made by [`ElmParams::fit_uncertain`] and
/// [`ElmParams::fit_ensemble`].
///
/// Keeps one number per training row and neuron beside the network.
///
/// ```
/// use elm::{Dataset, ElmParams};
/// use ndarray::{Array1, Axis, array};
///
/// let x = Array1::linspace(-3.0, 3.0, 80).insert_axis(Axis(1));
/// let t = x.column(0).mapv(|x: f64| x.sin() + 0.1 * (37.0 * x).sin());
/// let model = ElmParams::new(20).fit_uncertain(&Dataset::new(&x, &t)?)?;
/// // The noise is a sine of amplitude 0.1, of standard deviation 0.07.
/// assert!((0.05..0.1).contains(&model.noise()));
/// let y = model.model().predict(&array![[1.0]])?;
/// let (low, high) = model.predict_interval(&array![[1.0]], 0.8)?;
/// assert!(low[0] < y[0] && y[0] < high[0]);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct UncertainElm<A: Scalar, D: TargetDim = Ix2> {
    /// The networks, and what needs no rows.
    compact: CompactUncertainElm<A, D>,
    /// Of each member what needs the rows.
    members: Vec<LeftOut<A>>,
    /// Leave-one-out residuals of the mean, shape (rows, outputs).
    left_out: Array2<A>,
    /// The rows that count, and what they weigh.
    rows: CountedRows<A>,
    /// Their sizes over the deviation of a new observation there, in units of the noise, by the fit
    /// without the row.
    scores: Array2<A>,
}

/// What a network predicts without some of its rows.
#[derive(Debug, Clone)]
struct LeftOut<A: Scalar> {
    validator: CrossValidator<A>,
    /// Leave-one-out residuals, shape (rows, outputs).
    residuals: Array2<A>,
    /// One minus the leverage of each row, shape (rows, outputs).
    freedom: Array2<A>,
}

impl<A: Scalar> ElmParams<A> {
    /// Fits, and keeps what [`uncertainty`](crate::uncertainty) needs. Factorizes twice.
    ///
    /// # Errors
    /// Those of [`fit_dataset`](Self::fit_dataset); [`Error::Conflict`] unless the solver is ridge;
    /// [`Error::Undetermined`] when a row cannot be left out, as of a single one.
    pub fn fit_uncertain<D: TargetDim>(
        &self,
        data: &Dataset<'_, A, D>,
    ) -> Result<UncertainElm<A, D>> {
        let (member, left_out) = self.fit_member(data)?;
        UncertainElm::new((vec![member], vec![left_out]), data)
    }

    /// As [`fit_uncertain`](Self::fit_uncertain), of a feature map that is there already, as
    /// [`fit_map`](Self::fit_map): of a network from a file, say, whose rows are at hand again.
    ///
    /// # Errors
    /// Those of [`fit_uncertain`](Self::fit_uncertain) and [`fit_map`](Self::fit_map).
    pub fn fit_map_uncertain<D: TargetDim>(
        &self,
        map: FeatureMap<A>,
        data: &Dataset<'_, A, D>,
    ) -> Result<UncertainElm<A, D>> {
        self.check_ridge()?;
        let (member, left_out) = self.uncertain_member(self.fit_map(map, data)?, data)?;
        UncertainElm::new((vec![member], vec![left_out]), data)
    }

    /// Fits the mean of this many networks, which differ in their seeds alone: the parameters' seed
    /// and those that follow it. What their random layers do badly, each elsewhere, averages out.
    ///
    /// The mean is itself a network, with the neurons of all members side by side:
    /// [`UncertainElm::model`] predicts, and is packed and saved, like any other. Leaving out a row
    /// leaves it out of every member, so that the leave-one-out residuals of the mean are the means
    /// of theirs, exactly; its
    /// [`Diagnosis`](crate::solve::Diagnosis) has their RMSE, the mean of the members' effective
    /// degrees of freedom (which is that of the mean) and the geometric mean of their
    /// $\lambda$. Factorizes twice for each member.
    ///
    /// ```
    /// use elm::{Dataset, ElmParams};
    /// use ndarray::{Array1, Axis};
    ///
    /// let x = Array1::linspace(-3.0, 3.0, 80).insert_axis(Axis(1));
    /// let t = x.column(0).mapv(|x: f64| x.sin() + 0.05 * (37.0 * x).sin());
    /// let five = ElmParams::new(20).fit_ensemble(5, &Dataset::new(&x, &t)?)?;
    /// assert_eq!(five.model().hidden().neurons(), 100);
    /// let mean = five.leave_one_out();
    /// let alone = five.members_leave_one_out().column(0).sum() / 5.0;
    /// assert!(mean <= alone); // always: the mean of squares is at least the square of the mean
    /// # Ok::<(), elm::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Parameter`] for 0 members; those of [`fit_uncertain`](Self::fit_uncertain).
    pub fn fit_ensemble<D: TargetDim>(
        &self,
        members: usize,
        data: &Dataset<'_, A, D>,
    ) -> Result<UncertainElm<A, D>> {
        if members == 0 {
            return Err(Error::Parameter {
                name: "members",
                value: 0.0,
                expected: "at least 1",
            });
        }
        let member = |number| {
            let seed = self.seed().wrapping_add(number);
            self.clone().with_seed(seed).fit_member(data)
        };
        let members = (0..members as u64)
            .map(member)
            .collect::<Result<Vec<_>>>()?;
        UncertainElm::new(members.into_iter().unzip(), data)
    }

    fn fit_member<D: TargetDim>(
        &self,
        data: &Dataset<'_, A, D>,
    ) -> Result<(Member<A, D>, LeftOut<A>)> {
        self.check_ridge()?;
        self.uncertain_member(self.fit_dataset(data)?, data)
    }

    fn check_ridge(&self) -> Result<()> {
        if matches!(self.solver(), Solver::Ridge(_)) {
            return Ok(());
        }
        Err(Error::Conflict {
            first: "a solver other than ridge",
            second: "uncertainty",
        })
    }

    fn uncertain_member<D: TargetDim>(
        &self,
        model: Elm<A, D>,
        data: &Dataset<'_, A, D>,
    ) -> Result<(Member<A, D>, LeftOut<A>)> {
        let hidden = model.hidden_matrix(&data.inputs())?;
        let weights = data.weights();
        let problem = self.problem(&hidden, data.target_matrix(), weights.as_ref())?;
        let validator = CrossValidator::new(&problem)?;
        let lambda = &model.diagnosis().lambda;
        let held_out = match data.groups() {
            Some(groups) => validator.k_fold(groups, lambda),
            None => validator.leave_one_out(lambda),
        };
        let residuals = held_out?.residuals().to_owned();
        let posterior = validator.posterior();
        // At a training row the posterior's share of the variance, times the weight, is the leverage.
        let mut freedom = posterior.variance_factor(&hidden, lambda);
        freedom *= &validator.weights().insert_axis(Axis(1));
        freedom.mapv_inplace(|leverage| (A::one() - leverage).max(A::epsilon()));
        let left_out = LeftOut {
            validator,
            residuals,
            freedom,
        };
        Ok((Member { model, posterior }, left_out))
    }
}

impl<A: Scalar, D: TargetDim> UncertainElm<A, D> {
    fn new(
        (members, parts): (Vec<Member<A, D>>, Vec<LeftOut<A>>),
        data: &Dataset<'_, A, D>,
    ) -> Result<Self> {
        let (x, t) = (data.inputs(), data.target_matrix());
        let models: Vec<&Elm<A, D>> = members.iter().map(|member| &member.model).collect();
        let share = A::from_f64(members.len() as f64).recip();
        let rows = CountedRows::new(parts[0].validator.weights(), data.groups());
        let mut left_out = Array2::zeros(t.dim());
        // Times the weight of the row.
        let mut variances = Array2::ones(t.dim());
        for part in &parts {
            left_out.scaled_add(share, &part.residuals);
            if rows.groups.is_none() {
                // Of the fit without the row: h / (1 - h).
                variances.zip_mut_with(&part.freedom, |v: &mut A, &f| {
                    *v += share * (f.recip() - A::one());
                });
            }
        }
        let mut scores = Zip::from(&left_out)
            .and(&variances)
            .map_collect(|e, v| e.abs() / v.sqrt());
        scores *= &rows.weights.mapv(A::sqrt).insert_axis(Axis(1));
        let mut model = Elm::mean(&models);
        let residuals = &t - &model.predict_matrix(&x)?;
        if members.len() > 1 {
            model.set_errors(residuals.view(), left_out.view());
        }
        let count = rows.present.len() as f64;
        let noise = Zip::from(residuals.columns())
            .and(left_out.columns())
            .map_collect(|r, l| {
                let r = if rows.groups.is_some() { l } else { r };
                let products = r.iter().zip(l).zip(&rows.weights);
                let products = products.map(|((r, l), w)| r.as_f64() * l.as_f64() * w.as_f64());
                // Each product is a square over 1 - h, so only rounding can make it negative.
                A::from_f64((stats::sum(products).max(0.0) / count).sqrt())
            });
        let mut sorted = scores.select(Axis(0), &rows.present);
        for mut column in sorted.columns_mut() {
            let mut values = column.to_vec();
            values.sort_by(|a, b| a.as_f64().total_cmp(&b.as_f64()));
            column.assign(&Array1::from(values));
        }
        let compact = CompactUncertainElm {
            steepness: steepness(&model, &x.select(Axis(0), &rows.present)),
            model,
            members,
            scores: sorted,
            is_studentized: rows.groups.is_none(),
            noise,
            mean_weight: rows.mean,
        };
        Ok(Self {
            compact,
            members: parts,
            left_out,
            rows,
            scores,
        })
    }

    /// The network; of an ensemble the mean of its members.
    #[must_use]
    pub fn model(&self) -> &Elm<A, D> {
        &self.compact.model
    }

    /// Without the rows, to be kept in a file: deviations are the same, intervals nearly.
    #[must_use]
    pub fn compact(&self) -> CompactUncertainElm<A, D> {
        self.compact.clone()
    }

    /// The networks whose mean [`model`](Self::model) is: one, unless this is an ensemble.
    pub fn members(&self) -> impl ExactSizeIterator<Item = &Elm<A, D>> {
        self.compact.members.iter().map(|member| &member.model)
    }

    /// The leave-one-out RMSE of each output, with the weights of the rows; of rows with groups that of
    /// leaving out a group.
    #[must_use]
    pub fn leave_one_out(&self) -> D::PerOutput<f64> {
        let errors = self.rows.errors(self.left_out.view());
        per_output::<D, _>(errors.len(), |output| errors[output])
    }

    /// The leave-one-out RMSE that each member has by itself, shape (members, outputs): how much
    /// hangs on the seed, and how much better the mean is.
    #[must_use]
    pub fn members_leave_one_out(&self) -> Array2<f64> {
        let mut all = Array2::zeros((self.members.len(), self.left_out.ncols()));
        for (mut row, member) in all.rows_mut().into_iter().zip(&self.members) {
            row.assign(&self.rows.errors(member.residuals.view()));
        }
        all
    }

    /// The standard deviation of the members' predictions (with divisor one less than their number),
    /// shape (rows, outputs); 0 for one member. It says how much of a prediction is chance of the
    /// random layer, and nothing of noise or of what all members get wrong: for that see
    /// [`predict_deviation`](Self::predict_deviation).
    ///
    /// # Errors
    /// Those of [`Elm::predict`].
    pub fn members_spread<X: Inputs<A> + ?Sized>(&self, x: &X) -> Result<Array<A, D>> {
        let x = x.as_matrix();
        let predictions = self.members().map(|member| member.predict_matrix(&x));
        let predictions = predictions.collect::<Result<Vec<_>>>()?;
        let mean = self.model().predict_matrix(&x)?;
        let mut squares = Array2::zeros(mean.dim());
        for prediction in &predictions {
            squares += &(prediction - &mean).mapv_into(|d| d * d);
        }
        let others = A::from_f64(predictions.len().saturating_sub(1).max(1) as f64);
        finite(squares.mapv_into(|s: A| (s / others).sqrt())).map(D::of_matrix)
    }

    /// The estimated standard deviation of the noise of each output.
    #[must_use]
    pub fn noise(&self) -> D::PerOutput<A> {
        let noise = &self.compact.noise;
        per_output::<D, _>(noise.len(), |output| noise[output])
    }

    /// The standard deviation of a new observation: shape (rows, inputs) to (rows, outputs). Of an
    /// ensemble an upper bound: its variance is taken to be the mean of the members' variances, as
    /// if they all erred alike.
    ///
    /// # Errors
    /// Those of [`Elm::hidden_matrix`]; [`Error::Overflow`].
    pub fn predict_deviation<X: Inputs<A> + ?Sized>(&self, x: &X) -> Result<Array<A, D>> {
        self.compact.predict_deviation(x)
    }
}

/// The mean square slope of each output along each input, shape (inputs, outputs), over at most some
/// thousand rows spread evenly.
fn steepness<A: Scalar, D: TargetDim>(model: &Elm<A, D>, x: &ArrayRef2<A>) -> Array2<A> {
    const ROWS: usize = 1000;
    let rows = x
        .slice(s![..;x.nrows().div_ceil(ROWS).max(1), ..])
        .to_owned();
    let mut steepness = Array2::zeros((model.inputs(), model.outputs()));
    let count = A::from_f64(rows.nrows() as f64);
    for (gradient, mut column) in model.gradients(&rows).zip(steepness.columns_mut()) {
        column.assign(&gradient.map_axis(Axis(0), |slopes| slopes.dot(&slopes) / count));
    }
    steepness
}

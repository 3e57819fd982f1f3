//! Fits to rows that arrive in pieces: online, out of core, or from many machines.
//!
//! ```
//! use elm::{Accumulator, ElmParams, Scaler};
//! use elm::solve::Ridge;
//! use ndarray::{Array2, s};
//!
//! let x = Array2::from_shape_fn((300, 2), |(i, j)| ((i * (j + 3)) as f64 * 0.1).sin());
//! let t = x.map_axis(ndarray::Axis(1), |row| row[0] * row[1]);
//! let params = ElmParams::new(40).with_solver(Ridge::gcv());
//!
//! // Two workers, each with half of the rows, one of them in two pieces.
//! let mut one = Accumulator::with_scaler(&params, Scaler::measured(&x)?, 1)?;
//! let mut other = one.clone();
//! one.push(&x.slice(s![..100, ..]), &t.slice(s![..100]))?;
//! one.push(&x.slice(s![100..150, ..]), &t.slice(s![100..150]))?;
//! other.push(&x.slice(s![150.., ..]), &t.slice(s![150..]))?;
//! one.merge(&other)?;
//!
//! let model = one.fit()?;
//! let batch = params.fit(&x, &t)?;
//! assert!((model.predict(&x)? - batch.predict(&x)?).iter().all(|d| d.abs() < 1e-9));
//! # Ok::<(), elm::Error>(())
//! ```
//!
//! What is kept of the rows is the triangle $R$ of the QR factorization of $[1, H, T]$ (weighted),
//! and a block of rows that have not entered it yet: memory of order (neurons + outputs)², however
//! many rows there are. New rows are put under $R$ and the stack is factorized again; so are two
//! triangles that are merged (sequential and tree-shaped TSQR: Demmel, Grigori, Hoemmen and
//! Langou, Communication-optimal parallel and sequential QR, 2012). Orthogonal transformations add
//! errors of epsilon, not of the condition number squared as the sums of $H^T H$ that online ELMs
//! usually keep (Liang et al., OS-ELM, 2006): chunking, order and merging change the output weights
//! by no more than condition times epsilon.
//!
//! Eliminating the column of ones first centers the rest, so that $R$ without its first row is the
//! triangle of the centered problem, and the intercept is as unpenalized as in a batch fit.
//!
//! A given strength of ridge $\lambda$ from about 2e-8 (in `f32` 1e-4) up to 1e6 keeps sums of products well
//! conditioned. Then these are kept, of centered columns, as a batch fit takes them then: output weights are
//! off by no more than epsilon over $\lambda$, for less than half the time. Of a residual below the root of
//! epsilon times the targets' norm [`Diagnosis::residual_norm`](crate::solve::Diagnosis::residual_norm) has
//! no digits, as there are no rows to take it from.

mod chunks;
mod forget;
mod leverage;
mod likeness;
mod merge;
#[cfg(feature = "serde")]
mod parts;
mod products;
mod shift;
mod spectrum;
mod threaded;
#[cfg(feature = "serde")]
mod upper;

use std::marker::PhantomData;

use ndarray::{Array1, Array2, ArrayRef2, ArrayView1, ArrayView2, Axis, Ix2, ShapeBuilder, Zip, s};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use crate::bounds::Bounds;
use crate::check::{check_length, check_matrix};
use crate::dataset::{Dataset, Inputs, TargetDim, Targets, check_outputs};
use crate::error::{Error, Result};
use crate::feature_map::{FeatureMap, HiddenLayer, Scaler};
use crate::linalg::BAND;
use crate::memory::check_room;
use crate::model::ElmParams;
use crate::network::Elm;
use crate::scalar::{Scalar, power_of_two};
use crate::solve::Solver;

/// Rows in, a triangle or sums of products kept; see the [module](self).
///
/// The random layer and the standardization of inputs are fixed when it is made. The solver is that
/// of the parameters, except that leave-one-out, the default, needs the rows: an accumulator
/// chooses by generalized cross-validation in its place, so that
/// [`Diagnosis::leave_one_out`](crate::solve::Diagnosis::leave_one_out) is `None`.
///
/// ```
/// use elm::{Accumulator, ElmParams};
/// use ndarray::{Array2, Axis, array};
///
/// let params = ElmParams::new(20);
/// // What rows look like: two inputs between -1 and 1.
/// let sample = array![[-1.0, -1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, 1.0]];
/// let mut accumulator = Accumulator::from_sample(&params, &sample, 1)?;
/// for day in 0..30 {
///     let x = Array2::from_shape_fn((8, 2), |(i, j)| ((day * 8 + i) as f64 * (1.3 + j as f64)).sin());
///     accumulator.push(&x, &x.sum_axis(Axis(1)))?;
/// }
/// let model = accumulator.fit()?;
/// let y = model.predict(&array![[0.25, 0.5]])?;
/// assert!((y[0] - 0.75_f64).abs() < 1e-3);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", try_from = "parts::Parts<A>"))]
pub struct Accumulator<A: Scalar, D: TargetDim = Ix2> {
    map: FeatureMap<A>,
    solver: Solver,
    intercept: bool,
    inputs: usize,
    outputs: usize,
    rows: u64,
    /// Rows whose weight is not 0.
    weighted_rows: u64,
    /// Of these, for each input, those that are far from the scaler's mean.
    far: Vec<u64>,
    /// Whether rows may be unlike those that the scaler was measured on.
    unlike_rows: bool,
    /// What is kept of the rows, an upper half, square: the triangle, or [sums of products](products).
    /// Columns are the ones (with an intercept), neurons, outputs.
    #[cfg_attr(feature = "serde", serde(with = "upper"))]
    kept: Array2<A>,
    /// Powers of two that these columns were divided by.
    scales: Array1<A>,
    /// What was taken off the columns after the ones; none before there are rows.
    shift: Option<Array1<A>>,
    /// Weighted rows that have not entered yet, in the same columns, unscaled.
    pending: Vec<A>,
    bounded: bool,
    /// Of the rows so far whose weight is not 0.
    bounds: Option<Bounds<A>>,
    #[cfg_attr(feature = "serde", serde(skip))]
    dimension: PhantomData<D>,
}

impl<A: Scalar, D: TargetDim> Accumulator<A, D> {
    /// Draws the random layer, with inputs standardized by `scaler`, which must be the same for
    /// all accumulators that are to be merged.
    ///
    /// # Errors
    /// [`Error::Conflict`] when the parameters switch standardization off, lay biases, centers or ramps on
    /// the data or ask for the solver [`Inverse`](crate::solve::Inverse); [`Error::Parameter`] for 0
    /// outputs; [`Error::Shape`] for input scales; [`Error::TooLarge`].
    pub fn with_scaler(params: &ElmParams<A>, scaler: Scaler<A>, outputs: usize) -> Result<Self> {
        if params.feature_map().needs_rows() {
            return Err(Error::Conflict {
                first: "biases, centers or ramps on the data",
                second: "a layer drawn before there are rows",
            });
        }
        let none = Array2::zeros((0, scaler.mean().len()));
        Self::from_scaled_sample(params, scaler, &none, outputs)
    }

    /// As [`from_sample`](Self::from_sample), with a scaler that is known beforehand.
    fn from_scaled_sample(
        params: &ElmParams<A>,
        scaler: Scaler<A>,
        x: &ArrayRef2<A>,
        outputs: usize,
    ) -> Result<Self> {
        params.check()?;
        if !params.standardize() {
            return Err(Error::Conflict {
                first: "with_standardize(false)",
                second: "a scaler",
            });
        }
        check_length("columns of inputs", x.ncols(), scaler.mean().len())?;
        let map = params.feature_map();
        let map = map.draw_scaled(x.view(), Some(scaler), None)?;
        Self::new(params, map, outputs)
    }

    /// Draws the random layer for rows like those of `x`, shape (rows, inputs): inputs are
    /// standardized by their means and deviations, and biases laid on them, where the parameters
    /// say so, and ramps lie between their quantiles. The rows are not pushed. One sample gives accumulators
    /// that can be merged. Rows unlike the sample are refused; see [`push`](Self::push).
    ///
    /// # Errors
    /// [`Error::Empty`] and [`Error::NotFinite`] for `x`, and those of
    /// [`with_scaler`](Self::with_scaler).
    pub fn from_sample<X: Inputs<A> + ?Sized>(
        params: &ElmParams<A>,
        x: &X,
        outputs: usize,
    ) -> Result<Self> {
        params.check()?;
        let x = x.as_matrix();
        check_matrix("inputs", x)?;
        let map = params.feature_map();
        Self::new(params, map.draw_weighted(x, None)?, outputs)
    }

    fn new(params: &ElmParams<A>, map: FeatureMap<A>, outputs: usize) -> Result<Self> {
        if outputs == 0 {
            return Err(Error::Parameter {
                name: "outputs",
                value: 0.0,
                expected: "at least 1",
            });
        }
        check_outputs::<D>(outputs)?;
        let solver = params.solver();
        if matches!(solver, Solver::Inverse(_)) {
            return Err(Error::Conflict {
                first: "the solver 'inverse'",
                second: "an accumulator",
            });
        }
        let inputs = map.inputs();
        let intercept = params.intercept();
        let columns = usize::from(intercept)
            .saturating_add(map.features())
            .saturating_add(outputs);
        // Where the square fits, so does the block of rows.
        check_room(
            "the accumulator",
            columns,
            columns.saturating_mul(BLOCK + 2),
        )?;
        Ok(Self {
            map,
            solver: solver.without_rows(),
            intercept,
            inputs,
            outputs,
            rows: 0,
            weighted_rows: 0,
            far: vec![0; inputs],
            unlike_rows: false,
            kept: Array2::zeros((columns, columns)),
            scales: Array1::ones(columns),
            shift: None,
            pending: Vec::new(),
            bounded: params.bounded(),
            bounds: None,
            dimension: PhantomData,
        })
    }

    pub(crate) fn hidden(&self) -> &HiddenLayer<A> {
        self.map.layer()
    }

    /// Number of rows so far.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Whether rows may be unlike those that the scaler was measured on; they may not unless this is
    /// set, and [`push`](Self::push) says so.
    #[must_use]
    pub fn with_unlike_rows(mut self, allowed: bool) -> Self {
        self.unlike_rows = allowed;
        self
    }

    /// Whether rows may be unlike those that the scaler was measured on.
    #[must_use]
    pub fn unlike_rows(&self) -> bool {
        self.unlike_rows
    }

    /// Takes in rows: `x` has shape (rows, inputs), `t` (rows, outputs), or one value per row. No rows is
    /// fine.
    ///
    /// # Errors
    /// Those of [`Dataset::new`] and [`push_dataset`](Self::push_dataset).
    #[doc(alias = "partial_fit")]
    pub fn push<X, T>(&mut self, x: &X, t: &T) -> Result<()>
    where
        X: Inputs<A> + ?Sized,
        T: Targets<A, Dim = D> + ?Sized,
    {
        self.push_dataset(&Dataset::new(x, t)?)
    }

    /// As [`push`](Self::push), of rows that may have [weights](Dataset::with_weights), all of them 0 as
    /// well.
    ///
    /// # Errors
    /// [`Error::Shape`] for other numbers of inputs or outputs, [`Error::Overflow`] for values
    /// beyond the range once weighted. Where the scaler does not suit the rows, which no later rows
    /// mend: [`Error::ConstantInput`] for an input that was constant where the scaler was measured
    /// and is not here, [`Error::UnlikeRows`] for one that lies more than 10 of the scaler's
    /// deviations from its mean in more than a hundredth of the rows so far and ten more (by
    /// Chebyshev's inequality no rows of that mean and deviation do). Begin again with a scaler of a
    /// [`ScalerBuilder`](crate::ScalerBuilder) that has seen more rows, or
    /// [allow it](Self::with_unlike_rows). After an error nothing has been taken in.
    pub fn push_dataset(&mut self, data: &Dataset<'_, A, D>) -> Result<()> {
        let (x, t, weights) = (data.inputs(), data.target_matrix(), data.weights());
        check_length("columns of inputs", x.ncols(), self.inputs)?;
        check_length("outputs", t.ncols(), self.outputs)?;
        if x.nrows() == 0 {
            return Ok(());
        }
        let bounds = Bounds::of(x, t, weights, self.bounded);
        let far = self.far_off(x, weights)?;
        let before = (self.pending.len(), self.rows, self.weighted_rows);
        if self.pending.len() / self.columns() + x.nrows() >= self.block() {
            // What is kept will change: an error after that must leave no trace.
            let mut next = self.clone();
            next.take_in_parts(x, t, weights)?;
            *self = next;
            self.widen_bounds(bounds);
            self.far = far;
            return Ok(());
        }
        self.take_in(x, t, weights).inspect_err(|_| {
            self.pending.truncate(before.0);
            (self.rows, self.weighted_rows) = (before.1, before.2);
        })?;
        self.widen_bounds(bounds);
        self.far = far;
        Ok(())
    }

    fn widen_bounds(&mut self, others: Option<Bounds<A>>) {
        match (&mut self.bounds, others) {
            (Some(own), Some(others)) => own.widen(&others),
            (none, others) => {
                if none.is_none() {
                    *none = others;
                }
            }
        }
    }

    /// Adds checked rows, block by block.
    fn take_in(
        &mut self,
        x: ArrayView2<'_, A>,
        t: ArrayView2<'_, A>,
        weights: Option<ArrayView1<'_, A>>,
    ) -> Result<()> {
        let block = self.block();
        // No doubling: a block is all that is ever pending.
        let rows = (self.pending.len() / self.columns() + x.nrows()).min(block);
        let room = (rows * self.columns()).saturating_sub(self.pending.len());
        self.pending.reserve_exact(room);
        for start in (0..x.nrows()).step_by(block) {
            let range = s![start..x.nrows().min(start + block), ..];
            let x = x.slice(range);
            let h = self.map.apply(x);
            for (row, (h_row, t)) in h.rows().into_iter().zip(t.slice(range).rows()).enumerate() {
                let weight = weights.map_or(A::one(), |weights| weights[start + row]);
                self.rows = self.rows.saturating_add(1);
                if weight == A::zero() {
                    continue;
                }
                self.weighted_rows = self.weighted_rows.saturating_add(1);
                let root = weight.sqrt();
                if self.intercept {
                    self.pending.push(root);
                }
                let first = self.pending.len();
                self.pending.extend(h_row.iter().map(|&value| value * root));
                self.pending.extend(t.iter().map(|&value| value * root));
                let row = &self.pending[first..];
                if !row.iter().fold(true, |all, value| all & value.is_finite()) {
                    check_matrix("hidden-layer matrix", h.view())?;
                    return Err(OVERFLOW);
                }
                if self.pending.len() == block * self.columns() {
                    self.flush()?;
                }
            }
        }
        Ok(())
    }

    /// Solves for the output weights of all rows so far. More rows may be pushed afterwards.
    ///
    /// # Errors
    /// [`Error::Empty`] without rows of positive weight, and those of [`Solver::solve`].
    pub fn fit(&self) -> Result<Elm<A, D>> {
        if self.weighted_rows == 0 {
            return Err(Error::Empty {
                what: "accumulator",
                rows: 0,
                columns: self.columns(),
            });
        }
        let mut all = self.clone();
        all.flush()?;
        let solution = all.solve()?;
        Ok(Elm::assemble(all.map, solution, all.bounds))
    }

    fn columns(&self) -> usize {
        self.kept.ncols()
    }

    /// Rows that enter together.
    fn block(&self) -> usize {
        block::<A>(self.solver, self.columns())
    }

    /// Lets pending rows enter.
    fn flush(&mut self) -> Result<()> {
        let rows = self.pending.len() / self.columns();
        if rows == 0 {
            return Ok(());
        }
        let pending = std::mem::take(&mut self.pending);
        let shape = (rows, self.columns());
        let block = Array2::from_shape_vec(shape, pending).map_err(|_| OVERFLOW)?;
        if self.keeps_products() {
            return self.add_rows(block);
        }
        let shift = self.shift_for(&block);
        self.absorb(&block, &shift)
    }

    /// Factorizes the triangle with unscaled rows of finite numbers under it, less `shift` times the first
    /// value of each.
    fn absorb(&mut self, rows: &ArrayRef2<A>, shift: &Array1<A>) -> Result<()> {
        let columns = self.columns();
        let (largest, before) = (largest_less(rows, shift), largest(&self.kept));
        if !largest.iter().all(|v| v.is_finite()) {
            return Err(OVERFLOW);
        }
        let mut factors = Array1::ones(columns);
        for (column, scale) in self.scales.iter_mut().enumerate() {
            let fresh = before[column] == A::zero();
            let wanted = power_of_two(largest[column]);
            // Grows with the data; a power of two rounds nothing.
            if largest[column] > A::zero() && (fresh || wanted > *scale) {
                factors[column] = if fresh { A::one() } else { *scale / wanted };
                *scale = wanted;
            }
        }
        let mut both = Array2::zeros((columns + rows.nrows(), columns).f());
        let (mut top, mut bottom) = both.view_mut().split_at(Axis(0), columns);
        Zip::from(&mut top)
            .and(&self.kept)
            .and_broadcast(&factors)
            .for_each(|to, &kept, &factor| *to = kept * factor);
        let frame = shift.iter().zip(&self.scales);
        let bands = bottom.axis_chunks_iter_mut(Axis(0), BAND);
        for (mut to, rows) in bands.zip(rows.axis_chunks_iter(Axis(0), BAND)) {
            let columns = to.columns_mut().into_iter().zip(rows.columns());
            for ((to, from), (&shift, &scale)) in columns.zip(frame.clone()) {
                Zip::from(to)
                    .and(from)
                    .and(rows.column(0))
                    .for_each(|to, &value, &root| *to = (value - root * shift) / scale);
            }
        }
        let r = A::triangle(both)?;
        if !r.iter().all(|v| v.is_finite()) {
            return Err(OVERFLOW);
        }
        self.kept = r;
        Ok(())
    }
}

/// The largest magnitude in each column.
fn largest<A: Scalar>(rows: &ArrayRef2<A>) -> Array1<A> {
    largest_less(rows, &Array1::zeros(rows.ncols()))
}

/// The largest magnitude in each column of rows less `shift` times their first value.
fn largest_less<A: Scalar>(rows: &ArrayRef2<A>, shift: &Array1<A>) -> Array1<A> {
    let mut largest = Array1::zeros(rows.ncols());
    for row in rows.rows() {
        let root = row[0];
        Zip::from(&mut largest)
            .and(row)
            .and(shift)
            .for_each(|most: &mut A, &value, &shift| {
                *most = most.max((value - root * shift).abs());
            });
    }
    largest
}

/// Rows that enter together with this solver, of this number of columns. Sums of products cost the same by
/// any number.
fn block<A: Scalar>(solver: Solver, columns: usize) -> usize {
    match solver.strength_for_products::<A>() {
        Some(_) => columns,
        None => BLOCK * columns,
    }
}

/// Rows in a block, in units of the triangle's size: the triangle is factorized again with every
/// block, which costs a quarter more than one factorization of all rows.
const BLOCK: usize = 4;

const OVERFLOW: Error = Error::Overflow {
    what: "an accumulated value",
};

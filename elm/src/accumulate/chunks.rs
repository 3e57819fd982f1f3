//! Fits to an iterator of chunks of rows, on one thread or on several.

use ndarray::{Array, Array2, Axis, concatenate};

use super::Accumulator;
use crate::check::check_matrix;
use crate::dataset::TargetDim;
use crate::error::{Error, Result};
use crate::feature_map::Scaler;
use crate::memory::check_room;
use crate::model::ElmParams;
use crate::network::Elm;
use crate::scalar::Scalar;
use crate::threads;

const NO_CHUNKS: Error = Error::Empty {
    what: "chunks",
    rows: 0,
    columns: 0,
};

/// Rows that inputs are measured on, at least, unless there are fewer. What one row in a hundred has
/// is missing from a thousand with a probability of $0.99^{1000}$, 4e-5.
const SAMPLE_ROWS: usize = 1000;

/// Inputs and targets of some rows.
type Chunk<A, D> = (Array2<A>, Array<A, D>);

/// An accumulator, and the chunks that it was made for.
type Start<A, D> = (Accumulator<A, D>, Vec<Chunk<A, D>>);

/// The first chunks, up to [`SAMPLE_ROWS`] rows in total, and an accumulator made for rows like
/// these.
fn start<A: Scalar, D: TargetDim, E: From<Error>>(
    params: &ElmParams<A>,
    scaler: Option<Scaler<A>>,
    chunks: &mut impl Iterator<Item = Result<Chunk<A, D>, E>>,
) -> Result<Start<A, D>, E> {
    let wanted = if scaler.is_some() && !params.feature_map().needs_rows() {
        1
    } else {
        SAMPLE_ROWS
    };
    let (mut first, mut rows): (Vec<Chunk<A, D>>, _) = (Vec::new(), 0);
    while rows < wanted
        && let Some(chunk) = chunks.next().transpose()?
    {
        // Here, where a row still has its number in its chunk.
        check_matrix("inputs", chunk.0.view())?;
        rows += chunk.0.nrows();
        first.push(chunk);
    }
    let outputs = &first.first().ok_or(NO_CHUNKS)?.1;
    let outputs = D::matrix_view(outputs.view()).ncols();
    let sample = match first.as_slice() {
        [(x, _)] => Ok(x.view().into()),
        several => {
            let inputs: Vec<_> = several.iter().map(|(x, _)| x.view()).collect();
            concatenate(Axis(0), &inputs).map(ndarray::CowArray::from)
        }
    };
    let sample = sample.map_err(|_| {
        let inputs = first.iter().map(|(x, _)| x.ncols());
        let expected = first[0].0.ncols();
        Error::Shape {
            what: "columns of inputs",
            expected,
            found: inputs.into_iter().find(|&n| n != expected).unwrap_or(0),
        }
    })?;
    let accumulator = match scaler {
        Some(scaler) => Accumulator::from_scaled_sample(params, scaler, &sample, outputs)?,
        None => Accumulator::from_sample(params, &sample, outputs)?,
    };
    Ok((accumulator, first))
}

impl<A: Scalar> ElmParams<A> {
    /// Fits to chunks of rows that never stand in memory together: `chunks` yields inputs and
    /// targets as [`fit`](Self::fit) takes them, or the error of whatever reads them. Leave-one-out is
    /// replaced; see [`Accumulator`].
    ///
    /// Inputs are standardized by the **first** chunks, up to a thousand rows in total, which are in
    /// memory together until then. The others should be like them: an
    /// input that was constant and no longer is, or now lies far outside, is an
    /// [error](Accumulator::push). Rows in an order of their own, by time or place, are better measured
    /// first, all of them: [`fit_chunks_scaled`](Self::fit_chunks_scaled).
    ///
    /// ```
    /// use elm::{ElmParams, Error};
    /// use ndarray::{Array2, Axis};
    ///
    /// // Stands for a file that is read piece by piece.
    /// let chunks = (0..10).map(|chunk| {
    ///     let angle = |i, j| (chunk * 50 + i) as f64 * (0.1 + j as f64);
    ///     let x = Array2::from_shape_fn((50, 2), |(i, j)| angle(i, j).sin());
    ///     let t = x.map_axis(Axis(1), |row| row[0] * row[1]);
    ///     Ok::<_, Error>((x, t))
    /// });
    /// let model = ElmParams::new(60).fit_chunks(chunks)?;
    /// let y = model.predict(&ndarray::array![[0.5, -0.5]])?;
    /// assert!((y[0] + 0.25_f64).abs() < 0.01);
    /// # Ok::<(), Error>(())
    /// ```
    ///
    /// # Errors
    /// The first error of `chunks`, [`Error::Empty`] when there are none, and those of
    /// [`Accumulator::push`] and [`Accumulator::fit`].
    pub fn fit_chunks<D: TargetDim, E: From<Error>>(
        &self,
        chunks: impl IntoIterator<Item = Result<(Array2<A>, Array<A, D>), E>>,
    ) -> Result<Elm<A, D>, E> {
        self.fit_each(None, chunks.into_iter())
    }

    /// As [`fit_chunks`](Self::fit_chunks), with inputs standardized by a scaler that is known
    /// beforehand, as from a first pass over the chunks.
    ///
    /// ```
    /// use elm::{ElmParams, Error, ScalerBuilder};
    /// use ndarray::Array2;
    ///
    /// // Rows in rising order: the first chunk is unlike the rest.
    /// let chunk = |number: usize| {
    ///     let x = Array2::from_shape_fn((50, 1), |(i, _)| (number * 50 + i) as f64 * 0.01);
    ///     let t = x.mapv(f64::sin);
    ///     Ok::<_, Error>((x, t))
    /// };
    /// let mut measured = ScalerBuilder::new(1)?;
    /// for number in 0..40 {
    ///     measured.push(&chunk(number)?.0)?;
    /// }
    /// let params = ElmParams::new(60);
    /// let model = params.fit_chunks_scaled(measured.build()?, (0..40).map(chunk))?;
    /// let y = model.predict(&ndarray::array![[19.0]])?;
    /// assert!((y[[0, 0]] - 19.0_f64.sin()).abs() < 0.01);
    /// # Ok::<(), Error>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`fit_chunks`](Self::fit_chunks); [`Error::Conflict`] when the parameters switch
    /// standardization off, [`Error::Shape`] for a scaler of another number of inputs.
    pub fn fit_chunks_scaled<D: TargetDim, E: From<Error>>(
        &self,
        scaler: Scaler<A>,
        chunks: impl IntoIterator<Item = Result<(Array2<A>, Array<A, D>), E>>,
    ) -> Result<Elm<A, D>, E> {
        self.fit_each(Some(scaler), chunks.into_iter())
    }

    fn fit_each<D: TargetDim, E: From<Error>>(
        &self,
        scaler: Option<Scaler<A>>,
        mut chunks: impl Iterator<Item = Result<Chunk<A, D>, E>>,
    ) -> Result<Elm<A, D>, E> {
        let (mut accumulator, first) = start(self, scaler, &mut chunks)?;
        for chunk in first.into_iter().map(Ok).chain(chunks) {
            let (x, t) = chunk?;
            accumulator.push(&x, &t)?;
        }
        Ok(accumulator.fit()?)
    }

    /// As [`fit_chunks`](Self::fit_chunks), several chunks at a time on several [threads](crate::on_threads).
    ///
    /// Chunks are dealt in turn to `parts` accumulators, which are merged in that order at the
    /// end: the result depends on `parts`, within rounding error, and not on the number of
    /// threads. As many chunks are in memory at a time, and as many accumulators. More parts than
    /// threads gain nothing. Whether rows are like the first ones each part judges by its own.
    ///
    /// # Errors
    /// Those of [`fit_chunks`](Self::fit_chunks); [`Error::Parameter`] for no parts,
    /// [`Error::TooLarge`] for more than memory holds.
    pub fn fit_chunks_parallel<D: TargetDim, E: From<Error>>(
        &self,
        chunks: impl IntoIterator<Item = Result<(Array2<A>, Array<A, D>), E>>,
        parts: usize,
    ) -> Result<Elm<A, D>, E> {
        if parts == 0 {
            let (name, value, expected) = ("parts", 0.0, "at least 1");
            return Err(E::from(Error::Parameter {
                name,
                value,
                expected,
            }));
        }
        let mut chunks = chunks.into_iter();
        let (start, first) = start(self, None, &mut chunks)?;
        let columns = start.columns().saturating_mul(start.columns());
        check_room("the accumulators", parts, columns)?;
        let mut accumulators = vec![start; parts];
        let mut chunks = first.into_iter().map(Ok).chain(chunks);
        let mut round = Vec::new();
        loop {
            while round.len() < parts
                && let Some(chunk) = chunks.next().transpose()?
            {
                round.push(chunk);
            }
            if round.is_empty() {
                break;
            }
            let tasks = accumulators.iter_mut().zip(&round).collect();
            let push = |(accumulator, (x, t)): (&mut Accumulator<A, D>, &Chunk<A, D>)| {
                accumulator.push(x, t)
            };
            let pushed = threads::map(tasks, push);
            pushed.into_iter().collect::<Result<()>>()?;
            round.clear();
        }
        let mut accumulators = accumulators.into_iter();
        let mut whole = accumulators.next().ok_or(NO_CHUNKS)?;
        for part in accumulators {
            whole.merge(&part)?;
        }
        Ok(whole.fit()?)
    }
}

//! Fitting to an iterator of chunks, on one thread or on several.

use ndarray::Array2;
#[cfg(feature = "rayon")]
use rayon::prelude::*;

use super::Accumulator;
use crate::error::{Error, Result};
use crate::model::CheckedParams;
use crate::network::Elm;
use crate::scalar::Scalar;
#[cfg(feature = "rayon")]
use crate::solve::check_room;

const NO_CHUNKS: Error = Error::Empty {
    what: "chunks",
    rows: 0,
    columns: 0,
};

impl<A: Scalar> CheckedParams<A> {
    /// Fits to chunks of rows that never stand in memory together: `chunks` yields inputs and
    /// targets as [`fit`](Self::fit) takes them, or the error of whatever reads them. Inputs are
    /// standardised by the **first** chunk, which should be like the others. Leave-one-out is
    /// replaced; see [`Accumulator`].
    ///
    /// ```
    /// use elm::{ElmParams, Error};
    /// use ndarray::Array2;
    ///
    /// // Stands for a file that is read piece by piece.
    /// let chunks = (0..10).map(|chunk| {
    ///     let x = Array2::from_shape_fn((50, 2), |(i, j)| ((chunk * 50 + i) as f64 * (0.1 + j as f64)).sin());
    ///     let t = Array2::from_shape_fn((50, 1), |(i, _)| x[[i, 0]] * x[[i, 1]]);
    ///     Ok::<_, Error>((x, t))
    /// });
    /// let model = ElmParams::new(60).check()?.fit_chunks(chunks)?;
    /// let y = model.predict(&ndarray::array![[0.5, -0.5]])?;
    /// assert!((y[[0, 0]] + 0.25_f64).abs() < 0.01);
    /// # Ok::<(), Error>(())
    /// ```
    ///
    /// # Errors
    /// The first error of `chunks`, [`Error::Empty`] when there are none, and those of
    /// [`Accumulator::push`] and [`Accumulator::fit`].
    pub fn fit_chunks<E: From<Error>>(
        &self,
        chunks: impl IntoIterator<Item = Result<(Array2<A>, Array2<A>), E>>,
    ) -> Result<Elm<A>, E> {
        let mut accumulator: Option<Accumulator<A>> = None;
        for chunk in chunks {
            let (x, t) = chunk?;
            let accumulator = match &mut accumulator {
                Some(accumulator) => accumulator,
                none => none.insert(Accumulator::from_sample(self, &x, t.ncols())?),
            };
            accumulator.push(&x, &t)?;
        }
        Ok(accumulator.ok_or(NO_CHUNKS)?.fit()?)
    }

    /// As [`fit_chunks`](Self::fit_chunks), on the threads of the current rayon pool.
    ///
    /// Chunks are dealt in turn to `parts` accumulators, which are merged in that order at the
    /// end: the result depends on `parts`, within rounding error, and not on the number of
    /// threads. As many chunks are in memory at a time, and as many accumulators. More parts than
    /// threads gain nothing.
    ///
    /// # Errors
    /// Those of [`fit_chunks`](Self::fit_chunks); [`Error::Parameter`] for no parts,
    /// [`Error::TooLarge`] for more than memory holds.
    #[cfg(feature = "rayon")]
    pub fn fit_chunks_parallel<E: From<Error>>(
        &self,
        chunks: impl IntoIterator<Item = Result<(Array2<A>, Array2<A>), E>>,
        parts: usize,
    ) -> Result<Elm<A>, E> {
        if parts == 0 {
            let (name, value, expected) = ("parts", 0.0, "at least 1");
            return Err(E::from(Error::Parameter {
                name,
                value,
                expected,
            }));
        }
        let mut chunks = chunks.into_iter();
        let first = chunks.next().ok_or(NO_CHUNKS)??;
        let start = Accumulator::from_sample(self, &first.0, first.1.ncols())?;
        let columns = start.columns().saturating_mul(start.columns());
        check_room("the accumulators", parts, columns)?;
        let mut accumulators = vec![start; parts];
        let mut round = vec![first];
        while !round.is_empty() {
            while round.len() < parts {
                match chunks.next() {
                    Some(chunk) => round.push(chunk?),
                    None => break,
                }
            }
            let pushed: Vec<Result<()>> = accumulators
                .par_iter_mut()
                .zip(&round)
                .map(|(accumulator, (x, t))| accumulator.push(x, t))
                .collect();
            pushed.into_iter().collect::<Result<()>>()?;
            round.clear();
            round.extend(chunks.next().transpose()?);
        }
        let mut accumulators = accumulators.into_iter();
        let mut whole = accumulators.next().ok_or(NO_CHUNKS)?;
        for part in accumulators {
            whole.merge(&part)?;
        }
        Ok(whole.fit()?)
    }
}

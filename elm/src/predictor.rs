//! Evaluation of a fitted network, one row or millions, without allocation.
//!
//! A tile of rows is standardized; then, chunk of neurons by chunk, the weighted sums are taken,
//! the activation function applied, and the products with the output weights added up, while
//! everything stays in the first-level cache. The hidden-layer matrix never exists as a whole.

#[cfg(test)]
mod tests;

use std::marker::PhantomData;

use ndarray::{
    Array, Array2, ArrayRef, ArrayRef2, ArrayView2, ArrayViewMut2, Axis, Ix2, aview_mut1, aview1,
};

use crate::activation::Accuracy;
use crate::check::check_length;
use crate::dataset::{Inputs, TargetDim, Targets};
use crate::error::{Error, Result};
use crate::feature_map::{
    Accumulate, CHUNK_PANELS, PackedMap, TILE_ROWS, TileBuffers, sum_of_line, tile_rows,
};
use crate::memory::check_room;
use crate::metrics::r2;
use crate::network::Elm;
use crate::scalar::Scalar;
use crate::simd::{Aligned, zeros};
use crate::threads;

/// A fitted network packed for evaluation; made by [`Elm::predictor`].
///
/// The weights are laid out once in the order in which vector code reads them; the processor's
/// vector unit (AVX-512, AVX2 with FMA, NEON, or none) is found at run time.
///
/// A row's prediction does not depend on the rows beside it nor on the number of threads, and has
/// the same bits on every processor with fused multiply-add for the built-in activation
/// functions.
///
/// ```
/// use elm::ElmParams;
/// use ndarray::{Array1, Array2, Axis};
///
/// let x = Array1::linspace(-3.0, 3.0, 200).insert_axis(Axis(1));
/// let model = ElmParams::new(30).fit(&x, &x.mapv(f64::sin))?;
///
/// let predictor = model.predictor();
/// let mut scratch = predictor.scratch();
/// let mut y = Array2::zeros((200, 1));
/// predictor.predict_into(&x, &mut y, &mut scratch)?; // allocates nothing
/// assert_eq!(y, model.predict(&x)?);
///
/// let mut one = [0.0];
/// predictor.predict_row(&[0.5], &mut one, &mut scratch)?;
/// assert!((one[0] - 0.5_f64.sin()).abs() < 1e-3);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Predictor<A: Scalar, D: TargetDim = Ix2> {
    map: PackedMap<A>,
    intercept: Vec<A>,
    /// What each output is held between; empty where they are not.
    output_bounds: Vec<(A, A)>,
    dimension: PhantomData<D>,
}

impl<A: Scalar, D: TargetDim> Elm<A, D> {
    /// Predicts every output for every row: shape (rows, inputs) to (rows, outputs), or (rows) after a fit
    /// to one value per row. Outside the training rows predictions are held to their
    /// [`bounds`](Self::bounds).
    ///
    /// # Errors
    /// [`Error::Shape`] when the number of inputs differs from the training data's,
    /// [`Error::NotFinite`] for a NaN or infinity in `x`, [`Error::Overflow`] when a prediction is
    /// outside the range of the type. No rows is fine and gives no rows.
    pub fn predict<X: Inputs<A> + ?Sized>(&self, x: &X) -> Result<Array<A, D>> {
        self.predictor().predict(x)
    }

    /// As [`predict`](Self::predict), shape (rows, outputs) in any case.
    pub(crate) fn predict_matrix(&self, x: &ArrayRef2<A>) -> Result<Array2<A>> {
        self.predictor().predict_matrix(x.view())
    }

    /// The coefficient of determination $R^2$ of predictions for these rows, the mean over outputs: 1 for
    /// exact ones, 0 for none better than the mean of `t`. [`metrics`](crate::metrics) has it for each
    /// output.
    ///
    /// # Errors
    /// Those of [`predict`](Self::predict) and [`metrics::r2`](crate::metrics::r2).
    pub fn score<X, T>(&self, x: &X, t: &T) -> Result<f64>
    where
        X: Inputs<A> + ?Sized,
        T: Targets<A, Dim = D> + ?Sized,
    {
        let predicted = self.predict_matrix(&x.as_matrix())?;
        let each = r2(&predicted, &D::matrix_view(t.as_array()))?;
        Ok(each.sum() / each.len() as f64)
    }

    /// The network packed for evaluation: for many calls, few rows at a time, threads, or
    /// memory of the caller's own.
    #[must_use]
    pub fn predictor(&self) -> Predictor<A, D> {
        Predictor::new(self)
    }
}

/// Working memory of a [`Predictor`], some tens of kilobytes; made by [`Predictor::scratch`].
///
/// Each thread that predicts needs one of its own.
#[derive(Debug, Clone)]
pub struct Scratch<A: Scalar> {
    tile: TileBuffers<A>,
    /// A tile of sums, a line for each output.
    sums: Aligned<A>,
}

impl<A: Scalar, D: TargetDim> Predictor<A, D> {
    pub(crate) fn new(model: &Elm<A, D>) -> Self {
        let held = model.bounds().filter(|bounds| bounds.are_held());
        let inputs = held.map(|bounds| {
            let (lower, upper) = bounds.held_inputs();
            lower.into_iter().zip(upper)
        });
        let outputs = held.map(|bounds| {
            let (least, greatest) = bounds.predictions();
            least.into_iter().zip(greatest)
        });
        let input_bounds = inputs.into_iter().flatten().collect();
        Self {
            map: PackedMap::for_prediction(model.map(), model.beta(), input_bounds),
            intercept: model.intercept().to_vec(),
            output_bounds: outputs.into_iter().flatten().collect(),
            dimension: PhantomData,
        }
    }

    /// How exactly activation functions are evaluated; [`Accuracy::Full`] unless set.
    #[must_use]
    pub fn with_accuracy(mut self, accuracy: Accuracy) -> Self {
        self.map.accuracy = accuracy;
        self
    }

    /// How exactly activation functions are evaluated.
    #[must_use]
    pub fn accuracy(&self) -> Accuracy {
        self.map.accuracy
    }

    /// On this vector unit.
    #[cfg(test)]
    fn level(mut self, level: crate::simd::Level) -> Self {
        self.map.level = level;
        self
    }

    /// Number of inputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.map.inputs
    }

    /// Number of hidden neurons.
    #[must_use]
    pub fn neurons(&self) -> usize {
        self.map.packed.neurons
    }

    /// Number of outputs.
    #[must_use]
    pub fn outputs(&self) -> usize {
        self.map.packed.outputs
    }

    /// Working memory for this network.
    #[must_use]
    pub fn scratch(&self) -> Scratch<A> {
        Scratch {
            tile: self.map.buffers(),
            sums: zeros(self.sums_length()),
        }
    }

    fn sums_length(&self) -> usize {
        TILE_ROWS * self.outputs() * A::LINE
    }

    /// Predicts every output for every row: shape (rows, inputs) to (rows, outputs), or (rows) after a fit to
    /// one value per row; any strides.
    ///
    /// # Errors
    /// Those of [`predict_into`](Self::predict_into); [`Error::TooLarge`].
    pub fn predict<X: Inputs<A> + ?Sized>(&self, x: &X) -> Result<Array<A, D>> {
        Ok(D::of_matrix(self.predict_matrix(x.as_matrix())?))
    }

    fn predict_matrix(&self, x: ArrayView2<'_, A>) -> Result<Array2<A>> {
        check_length("columns of inputs", x.ncols(), self.inputs())?;
        check_room("the predictions", x.nrows(), self.outputs())?;
        let mut out = Array2::zeros((x.nrows(), self.outputs()));
        self.tasks(x, out.view_mut())?;
        Ok(out)
    }

    /// Rows dealt to threads, each with working memory of its own; sizes are right.
    fn tasks(&self, x: ArrayView2<'_, A>, mut out: ArrayViewMut2<'_, A>) -> Result<()> {
        // Enough work to outweigh handing it over.
        const TASK_ROWS: usize = 32 * TILE_ROWS;
        let tasks = x
            .axis_chunks_iter(Axis(0), TASK_ROWS)
            .zip(out.axis_chunks_iter_mut(Axis(0), TASK_ROWS))
            .enumerate()
            .collect();
        let done = threads::map_with(
            tasks,
            || self.scratch(),
            |scratch, (task, (x, out))| self.tiles(x, out, task * TASK_ROWS, scratch),
        );
        done.into_iter().collect()
    }

    /// As [`predict`](Self::predict) into `out`, without allocating.
    ///
    /// # Errors
    /// [`Error::Shape`] when `x`, `out` or `scratch` have the wrong size, [`Error::NotFinite`] for
    /// a NaN or infinity in `x`, [`Error::Overflow`] when a prediction is outside the range of the
    /// type. After the last two, rows of `out` before the one at fault may have been written.
    pub fn predict_into(
        &self,
        x: &ArrayRef2<A>,
        out: &mut ArrayRef<A, D>,
        scratch: &mut Scratch<A>,
    ) -> Result<()> {
        self.predict_into_matrix(x, D::matrix_view_mut(out.view_mut()), scratch)
    }

    fn predict_into_matrix(
        &self,
        x: &ArrayRef2<A>,
        out: ArrayViewMut2<'_, A>,
        scratch: &mut Scratch<A>,
    ) -> Result<()> {
        self.check(x, &out)?;
        let found = scratch.tile.lengths().into_iter();
        let found = found.chain([scratch.sums.as_slice().len()]);
        let expected = self.map.lengths().into_iter().chain([self.sums_length()]);
        for (found, expected) in found.zip(expected) {
            check_length("scratch", found, expected)?;
        }
        self.tiles(x.view(), out, 0, scratch)
    }

    /// As [`predict_into`](Self::predict_into) for a single row: `x` has the inputs, `out`
    /// receives the outputs.
    ///
    /// # Errors
    /// Those of [`predict_into`](Self::predict_into).
    pub fn predict_row(&self, x: &[A], out: &mut [A], scratch: &mut Scratch<A>) -> Result<()> {
        let x = aview1(x).insert_axis(Axis(0));
        let out = aview_mut1(out).insert_axis(Axis(0));
        self.predict_into_matrix(&x, out, scratch)
    }

    /// As [`predict_into`](Self::predict_into) on several [threads](crate::on_threads), each with working
    /// memory of its own, which is allocated. The result is the same bits for any number of threads.
    ///
    /// # Errors
    /// Those of [`predict_into`](Self::predict_into).
    pub fn predict_into_parallel(&self, x: &ArrayRef2<A>, out: &mut ArrayRef<A, D>) -> Result<()> {
        let out = D::matrix_view_mut(out.view_mut());
        self.check(x, &out)?;
        self.tasks(x.view(), out)
    }

    fn check(&self, x: &ArrayRef2<A>, out: &ArrayViewMut2<'_, A>) -> Result<()> {
        check_length("columns of inputs", x.ncols(), self.inputs())?;
        check_length("rows of predictions", out.nrows(), x.nrows())?;
        check_length("columns of predictions", out.ncols(), self.outputs())
    }

    /// Tile after tile; sizes are right. `offset` is the number of the first row in messages.
    fn tiles(
        &self,
        x: ArrayView2<'_, A>,
        mut out: ArrayViewMut2<'_, A>,
        offset: usize,
        scratch: &mut Scratch<A>,
    ) -> Result<()> {
        let tiles = x
            .axis_chunks_iter(Axis(0), TILE_ROWS)
            .zip(out.axis_chunks_iter_mut(Axis(0), TILE_ROWS));
        for (tile, (x, out)) in tiles.enumerate() {
            self.tile(x, out, offset + tile * TILE_ROWS, scratch)?;
        }
        Ok(())
    }

    fn tile(
        &self,
        x: ArrayView2<'_, A>,
        mut out: ArrayViewMut2<'_, A>,
        offset: usize,
        scratch: &mut Scratch<A>,
    ) -> Result<()> {
        let (rows, packed, level) = (x.nrows(), &self.map.packed, self.map.level);
        let sums = &mut scratch.sums[..rows * packed.outputs * A::LINE];
        sums.fill(A::zero());
        self.map.tile(x, offset, &mut scratch.tile, |chunk| {
            level.run(Accumulate {
                packed,
                first_panel: chunk.first_panel,
                panels: chunk.panels,
                hidden: chunk.hidden,
                sums,
            });
        })?;
        self.map.add_links(rows, &mut scratch.tile, sums);
        for first in (0..packed.link_panels).step_by(CHUNK_PANELS) {
            let inputs = &scratch.tile.inputs[..rows * packed.inputs];
            let panels = CHUNK_PANELS.min(packed.link_panels - first);
            let hidden = &mut scratch.tile.hidden[..rows * panels * A::LINE];
            link(inputs, packed.inputs, rows, first * A::LINE, hidden);
            level.run(Accumulate {
                packed,
                first_panel: packed.panels + first,
                panels,
                hidden,
                sums,
            });
        }

        let mut finite = true;
        for (mut out, sums) in out
            .rows_mut()
            .into_iter()
            .zip(sums.chunks_exact((packed.outputs * A::LINE).max(1)))
        {
            let sums = sums.chunks_exact(A::LINE).zip(&self.intercept);
            for (out, (line, &intercept)) in out.iter_mut().zip(sums) {
                *out = sum_of_line(line) + intercept;
                finite &= out.is_finite();
            }
            for (out, &(least, greatest)) in out.iter_mut().zip(&self.output_bounds) {
                // Written so that NaN stays.
                if *out > greatest {
                    *out = greatest;
                } else if *out < least {
                    *out = least;
                }
            }
        }
        if finite {
            Ok(())
        } else {
            Err(Error::Overflow {
                what: "a prediction",
            })
        }
    }
}

/// Copies inputs from `first` on as if they were hidden values, filled up with zeros.
fn link<A: Scalar>(x: &[A], inputs: usize, rows: usize, first: usize, hidden: &mut [A]) {
    let length = hidden.len() / rows;
    hidden.fill(A::zero());
    for (row, x) in tile_rows(x, inputs, rows) {
        let to = hidden.iter_mut().skip(row * length).take(length);
        to.zip(x.skip(first)).for_each(|(to, from)| *to = from);
    }
}

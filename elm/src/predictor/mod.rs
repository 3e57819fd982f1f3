//! Evaluation of a fitted network, one row or millions, without allocation.
//!
//! A tile of rows is standardised; then, chunk of neurons by chunk, the weighted sums are taken,
//! the activation function applied, and the products with the output weights added up, while
//! everything stays in the first-level cache. The hidden-layer matrix never exists as a whole.

mod kernels;
mod layer;
mod packed;
#[cfg(test)]
mod tests;

use ndarray::{Array2, ArrayRef2, ArrayView2, ArrayViewMut2, Axis, aview_mut1, aview1};

use crate::activation::Accuracy;
use crate::check::check_length;
use crate::error::{Error, Result};
use crate::memory::check_room;
use crate::network::Elm;
use crate::scalar::Scalar;
use crate::scaler::Scaler;
use crate::simd::{Aligned, Level, zeros};
use kernels::{Accumulate, Project, row_blocks, sum_of_line};
use packed::{CHUNK_PANELS, Packed, Panels};

pub(crate) use layer::LayerRows;

/// Rows evaluated together.
const TILE_ROWS: usize = 16;

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
pub struct Predictor<A: Scalar> {
    packed: Packed<A>,
    scaler: Option<Scaler<A>>,
    intercept: Vec<A>,
    /// What each input is held between, and each output; empty where they are not.
    input_bounds: Vec<(A, A)>,
    output_bounds: Vec<(A, A)>,
    accuracy: Accuracy,
    level: Level,
}

/// Working memory of a [`Predictor`], some tens of kilobytes; made by [`Predictor::scratch`].
///
/// Each thread that predicts needs one of its own.
#[derive(Debug, Clone)]
pub struct Scratch<A: Scalar> {
    /// A tile of inputs, standardised, as [`Project`] wants them.
    inputs: Aligned<A>,
    /// The same, multiplied by the scales of a group of radial neurons.
    scaled: Aligned<A>,
    /// A tile of one chunk of the hidden layer.
    hidden: Aligned<A>,
    /// A tile of sums, a line for each output.
    sums: Aligned<A>,
}

impl<A: Scalar> Predictor<A> {
    pub(crate) fn new(model: &Elm<A>) -> Self {
        let held = model.bounds().filter(|bounds| bounds.are_held());
        let inputs = held.map(|bounds| {
            let (lower, upper) = bounds.held_inputs();
            lower.into_iter().zip(upper)
        });
        let outputs = held.map(|bounds| {
            let (least, greatest) = bounds.predictions();
            least.into_iter().zip(greatest)
        });
        Self {
            packed: Packed::new(model.hidden(), model.beta()),
            scaler: model.scaler().cloned(),
            intercept: model.intercept().to_vec(),
            input_bounds: inputs.into_iter().flatten().collect(),
            output_bounds: outputs.into_iter().flatten().collect(),
            accuracy: Accuracy::Full,
            level: Level::best(),
        }
    }

    /// How exactly activation functions are evaluated; [`Accuracy::Full`] unless set.
    #[must_use]
    pub fn accuracy(mut self, accuracy: Accuracy) -> Self {
        self.accuracy = accuracy;
        self
    }

    /// On this vector unit.
    #[cfg(test)]
    fn level(mut self, level: Level) -> Self {
        self.level = level;
        self
    }

    /// Number of inputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.packed.inputs
    }

    /// Number of hidden neurons.
    #[must_use]
    pub fn neurons(&self) -> usize {
        self.packed.neurons
    }

    /// Number of outputs.
    #[must_use]
    pub fn outputs(&self) -> usize {
        self.packed.outputs
    }

    /// Working memory for this network.
    #[must_use]
    pub fn scratch(&self) -> Scratch<A> {
        let [inputs, scaled, hidden, sums] = self.scratch_lengths();
        Scratch {
            inputs: zeros(inputs),
            scaled: zeros(scaled),
            hidden: zeros(hidden),
            sums: zeros(sums),
        }
    }

    fn scratch_lengths(&self) -> [usize; 4] {
        let groups = &self.packed.groups;
        let neurons = groups.iter().map(|group| group.count);
        let panels = neurons.chain([self.packed.link_panels]).max().unwrap_or(0);
        let radial = groups.iter().any(|group| group.radial.is_some());
        [
            TILE_ROWS * self.inputs(),
            if radial { TILE_ROWS * self.inputs() } else { 0 },
            TILE_ROWS * panels.min(CHUNK_PANELS) * A::LINE,
            TILE_ROWS * self.outputs() * A::LINE,
        ]
    }

    /// Predicts every output for every row: shape (rows, inputs) to (rows, outputs), any strides.
    ///
    /// # Errors
    /// Those of [`predict_into`](Self::predict_into); [`Error::TooLarge`].
    pub fn predict(&self, x: &ArrayRef2<A>) -> Result<Array2<A>> {
        check_length("columns of inputs", x.ncols(), self.inputs())?;
        check_room("the predictions", x.nrows(), self.outputs())?;
        let mut out = Array2::zeros((x.nrows(), self.outputs()));
        self.predict_into(x, &mut out, &mut self.scratch())?;
        Ok(out)
    }

    /// As [`predict`](Self::predict) into `out`, shape (rows, outputs), without allocating.
    ///
    /// # Errors
    /// [`Error::Shape`] when `x`, `out` or `scratch` have the wrong size, [`Error::NotFinite`] for
    /// a NaN or infinity in `x`, [`Error::Overflow`] when a prediction is outside the range of the
    /// type. After the last two, rows of `out` before the one at fault may have been written.
    pub fn predict_into(
        &self,
        x: &ArrayRef2<A>,
        out: &mut ArrayRef2<A>,
        scratch: &mut Scratch<A>,
    ) -> Result<()> {
        self.check(x, out)?;
        let parts = [
            &scratch.inputs,
            &scratch.scaled,
            &scratch.hidden,
            &scratch.sums,
        ];
        let lengths = parts.map(|part| part.as_slice().len());
        for (found, expected) in lengths.into_iter().zip(self.scratch_lengths()) {
            check_length("scratch", found, expected)?;
        }
        self.tiles(x.view(), out.view_mut(), 0, scratch)
    }

    /// As [`predict_into`](Self::predict_into) for a single row: `x` has the inputs, `out`
    /// receives the outputs.
    ///
    /// # Errors
    /// Those of [`predict_into`](Self::predict_into).
    pub fn predict_row(&self, x: &[A], out: &mut [A], scratch: &mut Scratch<A>) -> Result<()> {
        let x = aview1(x).insert_axis(Axis(0));
        let mut out = aview_mut1(out).insert_axis(Axis(0));
        self.predict_into(&x, &mut out, scratch)
    }

    /// As [`predict_into`](Self::predict_into) on the threads of rayon's current pool, each with
    /// working memory of its own. The result is the same bits for any number of threads.
    ///
    /// # Errors
    /// Those of [`predict_into`](Self::predict_into); of several rows at fault, any may be named.
    #[cfg(feature = "rayon")]
    pub fn predict_into_parallel(&self, x: &ArrayRef2<A>, out: &mut ArrayRef2<A>) -> Result<()> {
        use ndarray::parallel::prelude::*;

        // Enough work to outweigh handing it over.
        const TASK_ROWS: usize = 32 * TILE_ROWS;
        self.check(x, out)?;
        if x.nrows() == 0 {
            return Ok(());
        }
        x.axis_chunks_iter(Axis(0), TASK_ROWS)
            .into_par_iter()
            .zip(out.axis_chunks_iter_mut(Axis(0), TASK_ROWS))
            .enumerate()
            .try_for_each_init(
                || self.scratch(),
                |scratch, (task, (x, out))| self.tiles(x, out, task * TASK_ROWS, scratch),
            )
    }

    fn check(&self, x: &ArrayRef2<A>, out: &ArrayRef2<A>) -> Result<()> {
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
        let (rows, packed) = (x.nrows(), &self.packed);
        let inputs = &mut scratch.inputs[..rows * packed.inputs];
        self.standardise(x, inputs, offset)?;
        let sums = &mut scratch.sums[..rows * packed.outputs * A::LINE];
        sums.fill(A::zero());

        for group in &packed.groups {
            let inputs = match &group.radial {
                None => &*inputs,
                Some(scales) => {
                    let scaled = &mut scratch.scaled[..rows * packed.inputs];
                    multiply(inputs, scales, rows, scaled);
                    &*scaled
                }
            };
            let end = group.first + group.count;
            for first_panel in (group.first..end).step_by(CHUNK_PANELS) {
                let panels = CHUNK_PANELS.min(end - first_panel);
                let hidden = &mut scratch.hidden[..rows * panels * A::LINE];
                self.level.run(Project {
                    packed,
                    first_panel,
                    panels,
                    rows,
                    radial: group.radial.is_some(),
                    inputs,
                    hidden,
                });
                self.activate(group, hidden, first_panel, panels);
                self.level.run(Accumulate {
                    packed,
                    first_panel,
                    panels,
                    hidden,
                    sums,
                });
            }
        }
        for first in (0..packed.link_panels).step_by(CHUNK_PANELS) {
            let panels = CHUNK_PANELS.min(packed.link_panels - first);
            let hidden = &mut scratch.hidden[..rows * panels * A::LINE];
            link(inputs, packed.inputs, rows, first * A::LINE, hidden);
            self.level.run(Accumulate {
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

    /// Copies a tile of inputs, standardised, into blocks of rows.
    fn standardise(&self, x: ArrayView2<'_, A>, to: &mut [A], offset: usize) -> Result<()> {
        let inputs = self.inputs();
        let mut finite = true;
        for (first, rows) in row_blocks(x.nrows()) {
            let block = &mut to[first * inputs..(first + rows) * inputs];
            for r in 0..rows {
                let row = x.row(first + r);
                let to = block.iter_mut().skip(r).step_by(rows);
                for (to, &value) in to.zip(row) {
                    finite &= value.is_finite();
                    *to = value;
                }
            }
            for (column, &(lower, upper)) in block.chunks_exact_mut(rows).zip(&self.input_bounds) {
                column.iter_mut().for_each(|x| *x = x.max(lower).min(upper));
            }
            if let Some(scaler) = &self.scaler {
                scaler.transform_columns(block.chunks_exact_mut(rows));
            }
        }
        if finite {
            return Ok(());
        }
        let place = x.indexed_iter().find(|(_, value)| !value.is_finite());
        let (row, column) = place.map_or((0, 0), |(place, _)| place);
        Err(Error::NotFinite {
            what: "inputs",
            row: offset + row,
            column,
        })
    }

    fn activate(&self, group: &Panels<A>, hidden: &mut [A], first_panel: usize, panels: usize) {
        let apply = |values: &mut [A]| {
            let function = &group.activation;
            function.apply_to_slice(self.level, self.accuracy, values);
        };
        let Some(used) = group.used(first_panel, panels) else {
            return apply(hidden);
        };
        for row in hidden.chunks_exact_mut(panels * A::LINE) {
            let (neurons, filling) = row.split_at_mut(used);
            apply(neurons);
            filling.fill(A::zero());
        }
    }
}

/// Multiplies inputs, in blocks of rows, by the scale of each.
fn multiply<A: Scalar>(inputs: &[A], scales: &[A], rows: usize, to: &mut [A]) {
    for (first, block) in row_blocks(rows) {
        let part = first * scales.len()..(first + block) * scales.len();
        let from = inputs[part.clone()].chunks_exact(block);
        let to = to[part].chunks_exact_mut(block);
        for ((from, to), &scale) in from.zip(to).zip(scales) {
            to.iter_mut().zip(from).for_each(|(to, &x)| *to = x * scale);
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

/// The rows of a tile of inputs, which lies in blocks of rows: (row, its inputs).
fn tile_rows<A: Scalar>(
    x: &[A],
    inputs: usize,
    rows: usize,
) -> impl Iterator<Item = (usize, impl Iterator<Item = A>)> {
    row_blocks(rows).flat_map(move |(first, block_rows)| {
        let block = &x[first * inputs..(first + block_rows) * inputs];
        (0..block_rows).map(move |r| {
            let values = block.iter().skip(r).step_by(block_rows).copied();
            (first + r, values)
        })
    })
}

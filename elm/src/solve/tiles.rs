//! Problems of many more rows than neurons, a tile of rows at a time: their triangle, and with it
//! their singular vectors, without the hidden-layer matrix.
//!
//! Everything is `f64`, whatever the rows are: an ELM's directions fall far below the resolution of
//! `f32`.

use std::ops::Range;

use ndarray::{Array1, Array2, ArrayView2, Axis, s};

use super::design_svd::DesignSvd;
use super::equilibration::{Equilibration, magnitudes};
use super::normal_equations::{RowSource, center_of, runs, spread_runs};
use super::stack::Stack;
use crate::error::Result;
use crate::feature_map::TileBuffers;
use crate::linalg::QrFactor;
use crate::scalar::{Scalar, power_of_two};
use crate::threads;

/// Numbers of rows and columns from which a problem is answered a tile at a time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Threshold {
    /// Rows for each column.
    rows_per_column: usize,
    /// Entries of the hidden-layer matrix.
    entries: usize,
}

impl Threshold {
    /// Below these a matrix is factorized as accurately as it can be, which costs no second look at the
    /// rows.
    pub(super) const TRIANGLE: Self = Self {
        rows_per_column: 16,
        entries: 1 << 20,
    };
    /// From these on sums of products, where their condition or the strength of ridge allows them, take less
    /// time than a factorization of the matrix.
    pub(super) const PRODUCTS: Self = Self {
        rows_per_column: 2,
        entries: 1 << 17,
    };

    /// Whether a problem of this size meets it.
    pub(super) fn is_met(self, rows: usize, columns: usize) -> bool {
        rows.saturating_mul(columns) >= self.entries && self.has_rows(rows, columns)
    }

    fn has_rows(self, rows: usize, columns: usize) -> bool {
        rows / self.rows_per_column >= columns
    }
}

/// Rows of a sample, in units of the columns: enough to see what the condition is about. At most a quarter
/// of the rows; of fewer than that takes none is taken.
const SAMPLE_PER_COLUMN: usize = 4;
const MIN_SAMPLE_PER_COLUMN: usize = 2;
/// Rows below which a sample's means are not yet near those of all rows.
pub(super) const MIN_SAMPLE: usize = 256;
/// Rows that enter the triangle together, in units of the columns: what is factorized again with
/// every block is a small part of it.
const BLOCK: usize = 6;
/// Bytes in a tile of rows, which should stay in the cache.
const TILE_BYTES: usize = 1 << 20;

/// The rows of a problem in `f64`: weighted, divided by powers of two, and less a shift.
pub(super) struct Tiles<'s, 'a, A: Scalar> {
    pub(super) source: &'s RowSource<'a, A>,
    /// Without means until they are known.
    pub(super) frame: Equilibration<f64>,
    /// Of hidden values and targets, in units of their scale: near the means, for a column that is
    /// constant its value. 0 without an intercept.
    pub(super) shift: Vec<f64>,
}

/// Working memory for a tile of rows, and its result.
pub(super) struct TileMemory<A: Scalar> {
    buffers: Option<TileBuffers<A>>,
    narrow: Vec<A>,
    wide: Array2<f64>,
}

impl<'s, 'a, A: Scalar> Tiles<'s, 'a, A> {
    /// Nothing where too few rows have a weight.
    ///
    /// # Errors
    /// Those of making the rows.
    pub(super) fn new(source: &'s RowSource<'a, A>, threshold: Threshold) -> Result<Option<Self>> {
        let weights = source.weights.map(A::widen);
        let weights = weights.as_ref().map(|weights| weights.view());
        let mut frame =
            Equilibration::of_weights(source.rows(), weights.as_ref(), source.intercept);
        if !threshold.has_rows(frame.weighted_rows, source.neurons()) {
            return Ok(None);
        }
        frame.hidden_scale = source.hidden.scale_wide(&frame.root_weights);
        frame.target_scale =
            magnitudes(source.targets, &frame.root_weights).mapv_into(power_of_two);
        frame.hidden_mean = Array1::zeros(source.neurons());
        frame.target_mean = Array1::zeros(source.outputs());
        let shift = vec![0.0; source.neurons() + source.outputs()];
        Ok(Some(Self {
            source,
            frame,
            shift,
        }))
    }

    pub(super) fn rows(&self) -> usize {
        self.frame.rows
    }

    pub(super) fn neurons(&self) -> usize {
        self.source.neurons()
    }

    pub(super) fn outputs(&self) -> usize {
        self.source.outputs()
    }

    pub(super) fn memory(&self) -> TileMemory<A> {
        TileMemory {
            buffers: self.source.hidden.buffers(),
            narrow: Vec::new(),
            wide: Array2::zeros((0, 0)),
        }
    }

    /// Parts of the rows, for a thread each.
    pub(super) fn parts(&self) -> Vec<Range<usize>> {
        self.source.parts()
    }

    /// Ranges of these rows, from the first to the last, each of a tile.
    pub(super) fn ranges(&self, rows: Range<usize>) -> impl Iterator<Item = Range<usize>> + use<A> {
        let step = (TILE_BYTES / size_of::<f64>() / self.source.width()).clamp(64, 1024);
        runs(rows, step)
    }

    /// Whether any of these rows has a weight.
    pub(super) fn is_empty(&self, rows: Range<usize>) -> bool {
        let roots = self.frame.root_weights.slice(s![rows]);
        roots.iter().all(|root| *root == 0.0)
    }

    /// These rows: hidden values and targets, and a one where there is an intercept, less `shift`,
    /// times the root of the row's weight. A row of weight 0 is 0, whatever is in it.
    ///
    /// # Errors
    /// Those of making the rows.
    pub(super) fn tile<'m>(
        &self,
        rows: Range<usize>,
        shift: &[f64],
        memory: &'m mut TileMemory<A>,
    ) -> Result<ArrayView2<'m, f64>> {
        let (neurons, width) = (self.neurons(), self.source.width());
        let TileMemory {
            buffers,
            narrow,
            wide,
        } = memory;
        if wide.nrows() < rows.len() {
            *wide = Array2::zeros((rows.len(), width));
        }
        let lines = wide.as_slice_mut().unwrap_or(&mut []);
        let (hidden_shift, target_shift) = shift.split_at(neurons);
        let scale = A::from_f64(self.frame.hidden_scale);
        let hidden = &self.source.hidden;
        if let Some(to) = A::of_wide(lines) {
            let shift: Vec<A> = hidden_shift
                .iter()
                .map(|&shift| A::from_f64(shift))
                .collect();
            hidden.write(rows.clone(), (scale, &shift), (to, width), buffers)?;
        } else {
            narrow.resize(rows.len() * neurons, A::zero());
            let none = vec![A::zero(); neurons];
            hidden.write(rows.clone(), (scale, &none), (narrow, neurons), buffers)?;
            for (to, hidden) in lines
                .chunks_exact_mut(width)
                .zip(narrow.chunks_exact(neurons))
            {
                for ((to, value), shift) in to.iter_mut().zip(hidden).zip(hidden_shift) {
                    *to = value.as_f64() - shift;
                }
            }
        }
        let targets = self.source.targets.slice(s![rows.clone(), ..]);
        let roots = self.frame.root_weights.slice(s![rows.clone()]);
        let lines = lines.chunks_exact_mut(width);
        for ((to, targets), &root) in lines.zip(targets.rows()).zip(roots) {
            if root == 0.0 {
                to.fill(0.0);
                continue;
            }
            let rest = &mut to[neurons..];
            for (((to, target), &scale), shift) in rest
                .iter_mut()
                .zip(targets)
                .zip(&self.frame.target_scale)
                .zip(target_shift)
            {
                *to = target.as_f64() / scale - shift;
            }
            if self.frame.intercept {
                to[width - 1] = 1.0;
            }
            if root != 1.0 {
                to.iter_mut().for_each(|value| *value *= root);
            }
        }
        Ok(wide.slice(s![..rows.len(), ..]))
    }

    /// At least `wanted` rows from everywhere, less their center, which the shift is set to.
    ///
    /// # Errors
    /// Those of making the rows.
    pub(super) fn look(&mut self, wanted: usize) -> Result<Array2<f64>> {
        let width = self.source.width();
        let wanted = wanted.max(MIN_SAMPLE).min(self.rows());
        let mut sample = Vec::with_capacity(wanted * width);
        let mut roots = Vec::with_capacity(wanted);
        let zeros = vec![0.0; self.shift.len()];
        let mut memory = self.memory();
        for run in spread_runs(self.rows(), wanted) {
            roots.extend(self.frame.root_weights.slice(s![run.clone()]));
            sample.extend(self.tile(run, &zeros, &mut memory)?);
        }
        let roots = Array1::from(roots);
        if self.frame.intercept {
            self.shift = center_of(&sample, width, &roots);
            for (row, root) in sample.chunks_exact_mut(width).zip(&roots) {
                for (value, shift) in row.iter_mut().zip(&self.shift) {
                    *value -= shift * root;
                }
            }
        }
        let shape = (sample.len() / width, width);
        Ok(Array2::from_shape_vec(shape, sample).unwrap_or_default())
    }

    /// Rows of a sample that tells what the condition is about.
    pub(super) fn sample_rows(&self) -> usize {
        let width = self.source.width();
        (self.rows() / 4).clamp(MIN_SAMPLE_PER_COLUMN * width, SAMPLE_PER_COLUMN * width)
    }

    /// The problem in the coordinates of its singular vectors, from the triangle; or nothing where the
    /// numbers are out of range. Rows have been looked at.
    ///
    /// # Errors
    /// Those of making the rows and of the factorizations.
    pub(super) fn spectrum_of_triangle(&self) -> Result<Option<DesignSvd<f64>>> {
        let Some((triangle, frame)) = self.triangle()? else {
            return Ok(None);
        };
        DesignSvd::of_triangle(triangle, frame).map(Some)
    }

    /// The triangle of the problem, and the frame with its means; or nothing where the numbers are
    /// out of range.
    ///
    /// # Errors
    /// Those of making the rows and of the factorization.
    pub(super) fn centered_triangle(
        &mut self,
    ) -> Result<Option<(QrFactor<f64>, Equilibration<f64>)>> {
        self.look(self.sample_rows())?;
        self.triangle()
    }

    /// The triangle of the ones, where there is an intercept, and the hidden values of all rows but
    /// these, less `shift`.
    ///
    /// # Errors
    /// Those of making the rows and of the factorization.
    pub(super) fn triangle_without(
        &mut self,
        left_out: &[usize],
        shift: &[f64],
    ) -> Result<QrFactor<f64>> {
        let roots = self.frame.root_weights.select(Axis(0), left_out);
        for &row in left_out {
            self.frame.root_weights[row] = 0.0;
        }
        let triangle = self.stacked(shift);
        for (&row, root) in left_out.iter().zip(roots) {
            self.frame.root_weights[row] = root;
        }
        triangle
    }

    /// The triangle of the centered rows, and their means.
    fn triangle(&self) -> Result<Option<(QrFactor<f64>, Equilibration<f64>)>> {
        Ok(self.centered(self.stacked(&self.shift)?, &self.shift))
    }

    /// The triangle of the rows, block after block (sequential TSQR: Demmel, Grigori, Hoemmen and
    /// Langou, Communication-optimal parallel and sequential QR, 2012). Eliminating the column of
    /// ones first centers the rest.
    fn stacked(&self, shift: &[f64]) -> Result<QrFactor<f64>> {
        let (neurons, outputs) = (self.neurons(), self.outputs());
        let columns = usize::from(self.frame.intercept) + neurons;
        let mut stack = Stack::new(columns, outputs, BLOCK * columns);
        // Made by several threads, a block at a time, and factorized in their order.
        let ranges: Vec<_> = self.ranges(0..self.rows()).collect();
        let block = stack
            .room()
            .div_ceil(ranges.first().map_or(1, ExactSizeIterator::len));
        for ranges in ranges.chunks(block.max(1)) {
            let tile_of = |memory: &mut TileMemory<A>, range: &Range<usize>| -> Result<_> {
                if self.is_empty(range.clone()) {
                    return Ok(None);
                }
                let tile = self.tile(range.clone(), shift, memory)?;
                Ok(Some(tile.to_owned()))
            };
            for tile in threads::map_with(ranges.iter().collect(), || self.memory(), tile_of) {
                let Some(tile) = tile? else { continue };
                let (hidden, rest) = tile.view().split_at(Axis(1), neurons);
                let (targets, ones) = rest.split_at(Axis(1), outputs);
                stack.push(ones, hidden, targets)?;
            }
        }
        stack.finish()
    }

    /// Without the column of ones, the means taken from its row.
    fn centered(
        &self,
        all: QrFactor<f64>,
        shift: &[f64],
    ) -> Option<(QrFactor<f64>, Equilibration<f64>)> {
        let QrFactor {
            mut r,
            mut qtb,
            mut residual_ss,
        } = all;
        let mut frame = self.frame.clone();
        if frame.intercept {
            let neurons = self.neurons();
            let (hidden_shift, target_shift) = shift.split_at(neurons);
            let ones = r[[0, 0]];
            let hidden_mean = &r.slice(s![0, 1..]) / ones + &Array1::from(hidden_shift.to_vec());
            let target_mean = &qtb.row(0) / ones + &Array1::from(target_shift.to_vec());
            r = r.slice(s![1.., 1..]).to_owned();
            qtb = qtb.slice(s![1.., ..]).to_owned();
            // What centering leaves of a constant is rounding, and would pass for a feature.
            let constant = |left: f64, mean: f64| {
                left.sqrt() <= 4.0 * f64::EPSILON * mean.abs() * frame.total_weight.sqrt()
            };
            let left = squares(r.view());
            for ((mut column, &left), &mean) in
                r.columns_mut().into_iter().zip(&left).zip(&hidden_mean)
            {
                if constant(left, mean) {
                    column.fill(0.0);
                }
            }
            let left = squares(qtb.view()) + &residual_ss;
            for (output, mut column) in qtb.columns_mut().into_iter().enumerate() {
                if constant(left[output], target_mean[output]) {
                    column.fill(0.0);
                    residual_ss[output] = 0.0;
                }
            }
            frame.hidden_mean = hidden_mean * frame.hidden_scale;
            frame.target_mean = target_mean * &frame.target_scale;
        }
        let largest = squares(r.view()).fold(0.0, |m: f64, v| m.max(*v));
        let bound = f64::MAX.sqrt();
        let in_range = largest == 0.0 || (bound.recip()..bound).contains(&largest);
        let finite = |values: &Array2<f64>| values.iter().all(|value| value.is_finite());
        let finite =
            finite(&r) && finite(&qtb) && residual_ss.iter().all(|value| value.is_finite());
        let triangle = QrFactor {
            r,
            qtb,
            residual_ss,
        };
        (in_range && finite).then_some((triangle, frame))
    }
}

/// Sum of squares of each column.
pub(super) fn squares(matrix: ArrayView2<'_, f64>) -> Array1<f64> {
    matrix.map_axis(Axis(0), |column| column.dot(&column))
}

impl<A: Scalar> QrFactor<A> {
    /// In another type.
    pub(super) fn narrow<B: Scalar>(self) -> QrFactor<B> {
        let value = |value: A| B::from_f64(value.as_f64());
        QrFactor {
            r: self.r.mapv_into_any(value),
            qtb: self.qtb.mapv_into_any(value),
            residual_ss: self.residual_ss.mapv_into_any(value),
        }
    }
}

//! Evaluation as a renderer wants it: many pairs of directions at once, component by component, in
//! single precision if that will do, from directions to reflectance without an angle's sine.
//!
//! [`Brdf::eval`](elm_datasets::Brdf::eval) is the general way and works in `f64` on pairs as they
//! come. [`Packed`] is a [`BrdfModel`](crate::model::BrdfModel) made ready for this one: lanes of the
//! vector unit are rows, the input scaling is folded into the weights, blocks of rows stay in the
//! first-level cache from end to end. The published neural model,
//! [`Nbrdf`](crate::baselines::Nbrdf), is evaluated by the same layers, so that comparing the two
//! compares the models.
//!
//! Values do not depend on which pairs are evaluated together. Between vector units they differ by
//! rounding where one has no fused multiply-add.
//!
//! ```
//! use elm_brdf::batch::{Columns, Packed};
//! use elm_brdf::model::Tuned;
//! use elm_datasets::Brdf;
//! use elm_datasets::{Invalid, MaterialId, synthetic};
//!
//! let data = synthetic::measurements(1, &[MaterialId::new(39)?], Invalid::Clamp);
//! let samples = data.samples(0).ok_or("no such material")?;
//! let pairs = &samples.directions;
//! let tuned = Tuned { neurons: Some(60), ..Tuned::default() };
//! let model = tuned.fit_model(pairs, samples.values.view())?;
//!
//! let packed: Packed<f32> = Packed::new(&model)?;
//! let directions: Columns<f32> = Columns::new(pairs);
//! let mut values = vec![0.0; 3 * pairs.len()]; // all reds, all greens, all blues
//! packed.eval_into(&directions, &mut values)?;
//! let red = model.eval(pairs)?[[0, 0]];
//! assert!((f64::from(values[0]) - red).abs() < 1e-3 * (1.0 + red));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod dense;
mod inputs;
mod packed;
mod real;

use elm_datasets::brdf::{EvalError, check_arguments};
use ndarray::{ArrayViewMut2, Axis};
use pulp::{Arch, Simd, WithSimd};

use crate::error::{Error, Result};
pub(crate) use dense::Dense;
use elm_datasets::geometry::DirectionPair;
pub(crate) use inputs::inputs_of;
pub use packed::Packed;
pub use real::Real;

/// Rows in a block.
pub(crate) const ROWS: usize = 64;

/// Pairs whose directions are turned into columns at a time: they stay in the second-level cache.
const CHUNK: usize = 1024;

/// One number of each row of a block, on a cache line of its own.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct Block<A>(pub(crate) [A; ROWS]);

impl<A: Real> Block<A> {
    pub(crate) fn zero() -> Self {
        Self([A::zero(); ROWS])
    }
}

/// Pairs of directions, component by component.
#[derive(Debug, Clone, PartialEq)]
pub struct Columns<A> {
    /// The components of $\omega_i$, then those of $\omega_o$.
    components: [Vec<A>; 6],
}

impl<A: Real> Columns<A> {
    /// The components of these pairs.
    #[must_use]
    pub fn new(pairs: &[DirectionPair]) -> Self {
        let mut columns = Self {
            components: std::array::from_fn(|_| Vec::new()),
        };
        columns.replace(pairs);
        columns
    }

    /// The components of these pairs in place of what was there, whose room is used again.
    fn replace(&mut self, pairs: &[DirectionPair]) {
        for (number, component) in self.components.iter_mut().enumerate() {
            let of = |pair: &DirectionPair| match number {
                0..3 => pair.incident[number],
                _ => pair.outgoing[number - 3],
            };
            component.clear();
            component.extend(pairs.iter().map(|pair| A::from_f64(of(pair))));
        }
    }

    /// Components that are in columns already: x, y and z of the directions towards the light and
    /// of those towards the viewer, in the frame of the surface.
    ///
    /// # Errors
    /// [`Error::Shape`] unless all six are of one length.
    pub fn from_components(incident: [Vec<A>; 3], outgoing: [Vec<A>; 3]) -> Result<Self> {
        let [a, b, c] = incident;
        let [d, e, f] = outgoing;
        let components = [a, b, c, d, e, f];
        let expected = components[0].len();
        match components.iter().find(|part| part.len() != expected) {
            None => Ok(Self { components }),
            Some(part) => Err(Error::Shape {
                what: "directions",
                expected,
                found: part.len(),
            }),
        }
    }

    /// Number of pairs.
    #[must_use]
    pub fn len(&self) -> usize {
        self.components[0].len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Something that evaluates directions in columns.
pub trait Batched<A: Real>: Sync {
    /// Values per pair of directions.
    fn channels(&self) -> usize;

    /// BRDF in 1/sr, without the cosine: all values of the first channel, then those of the next.
    /// 0 for a pair that is not above the horizon; a direction that is not finite gives finite
    /// values of no meaning.
    ///
    /// # Errors
    /// [`Error::Shape`] unless `out` has a value for each pair and channel.
    fn eval_into(&self, directions: &Columns<A>, out: &mut [A]) -> Result<()>;
}

/// A model's way to evaluate directions in columns, in the precision that it is packed in.
pub enum Precision<'a> {
    /// `f32`.
    Single(&'a dyn Batched<f32>),
    /// `f64`.
    Double(&'a dyn Batched<f64>),
}

/// [`Brdf::eval_into`](elm_datasets::Brdf::eval_into) by columns.
pub(crate) fn eval_pairs<A: Real>(
    model: &dyn Batched<A>,
    pairs: &[DirectionPair],
    mut values: ArrayViewMut2<'_, f64>,
) -> Result<(), EvalError> {
    let channels = model.channels();
    check_arguments(pairs, &values, channels)?;
    let mut directions = Columns::new(&[]);
    let mut found = vec![A::zero(); channels * pairs.len().min(CHUNK)];
    let rows = values.axis_chunks_iter_mut(Axis(0), CHUNK);
    for (pairs, mut rows) in pairs.chunks(CHUNK).zip(rows) {
        directions.replace(pairs);
        let found = &mut found[..channels * pairs.len()];
        model.eval_into(&directions, found)?;
        for (mut to, from) in rows
            .columns_mut()
            .into_iter()
            .zip(found.chunks_exact(pairs.len()))
        {
            for (to, from) in to.iter_mut().zip(from) {
                *to = from.as_f64();
            }
        }
    }
    Ok(())
}

/// How to evaluate one block.
pub(crate) trait Kernel<A: Real> {
    /// Blocks of working memory.
    fn scratch(&self) -> usize;

    /// `out` has a block for each channel.
    fn block<S: Simd>(
        &self,
        simd: S,
        directions: &[&[A; ROWS]; 6],
        scratch: &mut [Block<A>],
        out: &mut [Block<A>],
    );
}

/// Runs a kernel over all pairs, on the processor's best vector unit.
pub(crate) fn run<A: Real, K: Kernel<A>>(
    kernel: &K,
    channels: usize,
    directions: &Columns<A>,
    out: &mut [A],
) -> Result<()> {
    let rows = directions.len();
    // Not more than what is in memory already times what a model has.
    if Some(out.len()) != rows.checked_mul(channels) {
        return Err(Error::Shape {
            what: "values",
            expected: rows.saturating_mul(channels),
            found: out.len(),
        });
    }
    Arch::new().dispatch(Run {
        kernel,
        directions,
        scratch: vec![Block::zero(); kernel.scratch()],
        values: vec![Block::zero(); channels],
        out,
    });
    Ok(())
}

struct Run<'a, A, K> {
    kernel: &'a K,
    directions: &'a Columns<A>,
    scratch: Vec<Block<A>>,
    values: Vec<Block<A>>,
    out: &'a mut [A],
}

impl<A: Real, K: Kernel<A>> WithSimd for Run<'_, A, K> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let components = &self.directions.components;
        let rows = self.directions.len();
        for first in (0..rows).step_by(ROWS) {
            let count = ROWS.min(rows - first);
            let whole: [Option<&[A; ROWS]>; 6] =
                std::array::from_fn(|k| components[k][first..].first_chunk());
            // What fills up the last block are directions along the normal.
            let mut filled = [[A::zero(); ROWS]; 6];
            let directions: [&[A; ROWS]; 6] =
                if let [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f)] = whole {
                    [a, b, c, d, e, f]
                } else {
                    for (k, to) in filled.iter_mut().enumerate() {
                        *to = [if k % 3 == 2 { A::one() } else { A::zero() }; ROWS];
                        to[..count].copy_from_slice(&components[k][first..]);
                    }
                    std::array::from_fn(|k| &filled[k])
                };
            self.kernel
                .block(simd, &directions, &mut self.scratch, &mut self.values);
            for (out, block) in self.out.chunks_exact_mut(rows).zip(&self.values) {
                out[first..first + count].copy_from_slice(&block.0[..count]);
            }
        }
    }
}

#[cfg(test)]
mod tests;

//! Many rows at once, which several threads take in.

use std::ops::Range;

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, s};

use super::{Accumulator, BLOCK};
use crate::dataset::TargetDim;
use crate::error::Result;
use crate::scalar::Scalar;
use crate::threads;

impl<A: Scalar, D: TargetDim> Accumulator<A, D> {
    /// Adds checked rows; where they are many, in parts that several threads factorize, each by itself.
    pub(super) fn take_in_parts(
        &mut self,
        x: ArrayView2<'_, A>,
        t: ArrayView2<'_, A>,
        weights: Option<ArrayView1<'_, A>>,
    ) -> Result<()> {
        /// Blocks of a part: merging it costs less than half a block.
        const BLOCKS: usize = 4;
        /// Numbers in what all parts keep.
        const ROOM: usize = 1 << 25;
        let square = self.columns().saturating_mul(self.columns());
        let most = (ROOM / square.saturating_mul(BLOCK + 2).max(1)).min(16);
        let parts = (x.nrows() / (BLOCKS * self.block())).min(most);
        if parts < 2 {
            return self.take_in(x, t, weights);
        }
        let empty = self.without_rows();
        let part_of = |rows: Range<usize>| -> Result<Self> {
            let mut part = empty.clone();
            let weights = weights.map(|weights| weights.slice_move(s![rows.clone()]));
            part.take_in(
                x.slice(s![rows.clone(), ..]),
                t.slice(s![rows, ..]),
                weights,
            )?;
            part.flush()?;
            Ok(part)
        };
        let parts = threads::map(threads::split(x.nrows(), parts), part_of);
        let mut parts = parts.into_iter().collect::<Result<Vec<_>>>()?;
        // By twos, which are merged at the same time.
        while parts.len() > 1 {
            let mut pairs = Vec::new();
            let mut rest = parts.into_iter();
            while let Some(first) = rest.next() {
                pairs.push((first, rest.next()));
            }
            let merged = threads::map(pairs, |(mut first, second)| -> Result<Self> {
                if let Some(second) = second {
                    first.merge_alike(&second)?;
                }
                Ok(first)
            });
            parts = merged.into_iter().collect::<Result<_>>()?;
        }
        parts.iter().try_for_each(|part| self.merge_alike(part))
    }

    /// As it was before the first row.
    fn without_rows(&self) -> Self {
        Self {
            rows: 0,
            weighted_rows: 0,
            far: vec![0; self.inputs],
            kept: Array2::zeros(self.kept.dim()),
            scales: Array1::ones(self.columns()),
            shift: None,
            pending: Vec::new(),
            bounds: None,
            map: self.map.clone(),
            ..*self
        }
    }
}

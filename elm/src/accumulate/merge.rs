//! What carries rows from one accumulator to another: merging, and a compact form.

use ndarray::Array1;

use super::{Accumulator, OVERFLOW};
use crate::dataset::TargetDim;
use crate::error::{Error, Result};
use crate::scalar::Scalar;

impl<A: Scalar, D: TargetDim> Accumulator<A, D> {
    /// Takes in all that `other` has taken in: as rows where none has entered its triangle or sums yet, which
    /// costs no factorization here either, else these.
    ///
    /// # Errors
    /// [`Error::Mismatch`] naming what differs: the random layer, the scaler, the outputs, or the
    /// settings of the solve.
    pub fn merge(&mut self, other: &Self) -> Result<()> {
        for (what, same) in [
            ("random layers", self.map.layer() == other.map.layer()),
            ("scalers of inputs", self.map.scaler() == other.map.scaler()),
            ("ramps of inputs", self.map.ramps() == other.map.ramps()),
            ("numbers of outputs", self.outputs == other.outputs),
            (
                "direct links",
                self.map.direct_links() == other.map.direct_links(),
            ),
            ("intercepts", self.intercept == other.intercept),
            ("solvers", self.solver == other.solver),
            ("bounds of predictions", self.bounded == other.bounded),
        ] {
            if !same {
                return Err(Error::Mismatch { what });
            }
        }
        let mut next = self.clone();
        next.merge_alike(other)?;
        *self = next;
        Ok(())
    }

    /// As [`merge`](Self::merge), of one with the same layer and settings; after an error half done.
    pub(super) fn merge_alike(&mut self, other: &Self) -> Result<()> {
        self.widen_bounds(other.bounds.clone());
        if other.has_kept() {
            let mut other = other.clone();
            self.flush()?;
            other.flush()?;
            if self.keeps_products() {
                self.add_products(&other)?;
            } else {
                let mut rows = &other.kept * &other.scales;
                self.take_over(&other, rows.view_mut());
                if !rows.iter().all(|value| value.is_finite()) {
                    return Err(OVERFLOW);
                }
                self.absorb(&rows, &Array1::zeros(rows.ncols()))?;
            }
        } else {
            self.take_pending(&other.pending)?;
        }
        self.rows = self.rows.saturating_add(other.rows);
        self.weighted_rows = self.weighted_rows.saturating_add(other.weighted_rows);
        for (far, more) in self.far.iter_mut().zip(&other.far) {
            *far = far.saturating_add(*more);
        }
        Ok(())
    }

    /// Whether rows have entered what is kept.
    fn has_kept(&self) -> bool {
        self.kept.iter().any(|value| *value != A::zero())
    }

    /// Takes in rows that have not entered another's either.
    fn take_pending(&mut self, rows: &[A]) -> Result<()> {
        let block = self.block() * self.columns();
        for row in rows.chunks_exact(self.columns()) {
            self.pending.extend(row);
            if self.pending.len() == block {
                self.flush()?;
            }
        }
        Ok(())
    }

    /// Lets all rows enter the triangle or the sums, of which a file then holds little more: half the square
    /// of neurons and outputs in numbers, where rows that wait to enter together are several times as many.
    /// Costs a factorization where a triangle is kept. Rows that are fewer numbers than it stay as they are.
    ///
    /// # Errors
    /// [`Error::Overflow`] for values beyond the range; nothing has changed then.
    pub fn compact(&mut self) -> Result<()> {
        let triangle = self.columns() * (self.columns() + 1) / 2;
        if self.pending.len() < triangle && !self.has_kept() {
            return Ok(());
        }
        let mut next = self.clone();
        next.flush()?;
        next.pending = Vec::new();
        *self = next;
        Ok(())
    }
}

//! The triangle of rows that arrive in blocks.

use ndarray::{Array1, Array2, ArrayView2, ShapeBuilder, s};

use crate::error::Result;
use crate::linalg::{Backend, QrFactor};

/// A triangle on top of rows that are to enter it.
pub(super) struct Stack {
    hidden: Array2<f64>,
    targets: Array2<f64>,
    residual_ss: Array1<f64>,
    filled: usize,
}

impl Stack {
    pub(super) fn new(columns: usize, outputs: usize, block: usize) -> Self {
        Self {
            hidden: Array2::zeros((columns + block, columns).f()),
            targets: Array2::zeros((columns + block, outputs).f()),
            residual_ss: Array1::zeros(outputs),
            filled: columns,
        }
    }

    /// Rows of a block.
    pub(super) fn room(&self) -> usize {
        self.hidden.nrows() - self.hidden.ncols()
    }

    pub(super) fn push(
        &mut self,
        ones: ArrayView2<'_, f64>,
        hidden: ArrayView2<'_, f64>,
        targets: ArrayView2<'_, f64>,
    ) -> Result<()> {
        let mut first = 0;
        while first < hidden.nrows() {
            let room = self.hidden.nrows() - self.filled;
            let from = first..hidden.nrows().min(first + room);
            let to = self.filled..self.filled + from.len();
            let mut rows = self.hidden.slice_mut(s![to.clone(), ..]);
            rows.slice_mut(s![.., ..ones.ncols()])
                .assign(&ones.slice(s![from.clone(), ..]));
            rows.slice_mut(s![.., ones.ncols()..])
                .assign(&hidden.slice(s![from.clone(), ..]));
            self.targets
                .slice_mut(s![to.clone(), ..])
                .assign(&targets.slice(s![from.clone(), ..]));
            (first, self.filled) = (from.end, to.end);
            if self.filled == self.hidden.nrows() {
                self.factorize()?;
            }
        }
        Ok(())
    }

    fn factorize(&mut self) -> Result<()> {
        let rows = s![..self.filled, ..];
        let QrFactor {
            r,
            qtb,
            residual_ss,
        } = f64::triangularize(self.hidden.slice(rows), self.targets.slice(rows))?;
        self.filled = r.nrows();
        let top = s![..self.filled, ..];
        self.hidden.slice_mut(top).assign(&r);
        self.targets.slice_mut(top).assign(&qtb);
        self.residual_ss += &residual_ss;
        Ok(())
    }

    pub(super) fn finish(mut self) -> Result<QrFactor<f64>> {
        self.factorize()?;
        let top = s![..self.filled, ..];
        Ok(QrFactor {
            r: self.hidden.slice(top).to_owned(),
            qtb: self.targets.slice(top).to_owned(),
            residual_ss: self.residual_ss,
        })
    }
}

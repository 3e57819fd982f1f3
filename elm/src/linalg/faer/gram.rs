//! Products of a matrix with its own transpose, of which half is needed.

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::reborrow::ReborrowMut;
use faer::traits::RealField;
use faer::{Accum, MatMut, MatRef};
use ndarray::{Array2, ArrayView2};
use num_traits::Zero;

use super::{PAR, gapless, view, view_mut};

/// Bytes in a row of a block of columns: a whole number of the product's own tiles.
const BLOCK_BYTES: usize = 384;
/// Up to this number of blocks, copying costs as much as it saves.
const FEW_BLOCKS: usize = 5;

/// Adds the lower half of $A^T A$; `blocks` is room for a copy of a wide matrix.
pub(super) fn add_gram<A: RealField + Copy + Zero>(
    a: ArrayView2<'_, A>,
    sum: &mut Array2<A>,
    blocks: &mut Vec<A>,
) {
    if a.is_empty() {
        return;
    }
    let (rows, columns) = a.dim();
    let width = BLOCK_BYTES / size_of::<A>();
    let mut sum = view_mut(sum);
    match a.to_slice() {
        // Where each row of a wide matrix is on a page of its own, finding the pages takes longer
        // than multiplying; rows of a block of columns lie close together.
        Some(values) if columns > FEW_BLOCKS * width => {
            blocks.resize(values.len(), A::zero());
            copy_in_blocks(values, columns, blocks, rows, width);
            for (j, right) in blocks.chunks(rows * width).enumerate() {
                let right = MatRef::from_row_major_slice(right, rows, right.len() / rows);
                for (i, left) in blocks.chunks(rows * width).enumerate().skip(j) {
                    let left = MatRef::from_row_major_slice(left, rows, left.len() / rows);
                    let (i, j) = (i * width, j * width);
                    let part = sum.rb_mut();
                    let part = part.submatrix_mut(i, j, left.ncols(), right.ncols());
                    if i == j {
                        add_gram_of(left, part);
                    } else {
                        let one = faer::traits::math_utils::one();
                        matmul(part, Accum::Add, left.transpose(), right, one, PAR);
                    }
                }
            }
        }
        _ => {
            let a = gapless(a);
            add_gram_of(view(a.view()), sum);
        }
    }
}

/// Copies a matrix that lies by rows into blocks of `width` columns, one after the other, each by
/// rows.
fn copy_in_blocks<A: Copy>(
    values: &[A],
    columns: usize,
    blocks: &mut [A],
    rows: usize,
    width: usize,
) {
    let firsts = (0..columns).step_by(width);
    for (block, first) in blocks.chunks_mut(rows * width).zip(firsts) {
        let width = block.len() / rows;
        let from = values.chunks_exact(columns);
        for (to, from) in block.chunks_exact_mut(width).zip(from) {
            to.copy_from_slice(&from[first..first + width]);
        }
    }
}

/// Half the work of a product.
fn add_gram_of<A: RealField + Copy>(a: MatRef<'_, A>, sum: MatMut<'_, A>) {
    triangular::matmul(
        sum,
        BlockStructure::TriangularLower,
        Accum::Add,
        a.transpose(),
        BlockStructure::Rectangular,
        a,
        BlockStructure::Rectangular,
        faer::traits::math_utils::one(),
        PAR,
    );
}

//! Products of a matrix with its own transpose, of which half is needed.

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::reborrow::ReborrowMut;
use faer::traits::RealField;
use faer::{Accum, MatMut, MatRef};
use ndarray::{Array2, ArrayView2};
use num_traits::Zero;

use super::{PAR, clean, gapless, view, view_mut};
use crate::threads;

/// Bytes in a row of a block of columns: a whole number of the product's own tiles.
const BLOCK_BYTES: usize = 384;
/// Up to this number of blocks, copying costs as much as it saves.
const FEW_BLOCKS: usize = 5;
/// Multiplications from which a product is shared among threads; below, whole products are.
const LARGE: usize = 1 << 27;

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
    let sum = view_mut(sum);
    match a.to_slice() {
        // Where each row of a wide matrix is on a page of its own, finding the pages takes longer
        // than multiplying; rows of a block of columns lie close together.
        Some(values) if columns > FEW_BLOCKS * width => {
            blocks.resize(values.len(), A::zero());
            copy_in_blocks(values, columns, blocks, rows, width);
            let blocks = &*blocks;
            let mut rest = sum;
            let mut slabs = Vec::new();
            for (j, right) in blocks.chunks(rows * width).enumerate() {
                let (slab, others) = rest.split_at_col_mut(right.len() / rows);
                slabs.push((j, slab));
                rest = others;
            }
            let add = |(j, mut slab): (usize, MatMut<'_, A>)| {
                let lefts = blocks.chunks(rows * width).enumerate().skip(j);
                let right = &blocks[j * rows * width..][..rows * slab.ncols()];
                let right = MatRef::from_row_major_slice(right, rows, slab.ncols());
                lefts.for_each(|(i, left)| {
                    let left = MatRef::from_row_major_slice(left, rows, left.len() / rows);
                    let part = slab.rb_mut();
                    let part = part.subrows_mut(i * width, left.ncols());
                    if i == j {
                        add_gram_of(left, part);
                    } else {
                        let one = faer::traits::math_utils::one();
                        matmul(part, Accum::Add, left.transpose(), right, one, PAR);
                    }
                });
            };
            if values.len().saturating_mul(columns) < LARGE {
                slabs.into_iter().for_each(add);
            } else {
                threads::map(slabs, |slab| {
                    add(slab);
                    clean(());
                });
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

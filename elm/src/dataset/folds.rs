//! Division of rows into folds.

use std::collections::BTreeMap;

use rand::seq::SliceRandom;

use crate::error::{Error, Result};
use crate::memory::check_room;
use crate::stream::Stream;

fn check_folds(rows: usize, folds: usize) -> Result<()> {
    if folds < 2 || folds > rows {
        return Err(Error::Parameter {
            name: "folds",
            value: folds as f64,
            expected: "at least 2 and at most the number of rows",
        });
    }
    check_room("the fold labels", rows, 1)
}

/// Assigns each row to one of `folds` folds at random, sizes differing by at most 1; one seed
/// gives one assignment on every platform.
///
/// # Errors
/// [`Error::Parameter`] unless $2 \le$ `folds` $\le$ `rows`; [`Error::TooLarge`].
pub fn assign_folds(rows: usize, folds: usize, seed: u64) -> Result<Vec<usize>> {
    check_folds(rows, folds)?;
    let mut labels: Vec<usize> = (0..rows).map(|row| row % folds).collect();
    labels.shuffle(&mut Stream::Folds.of(seed));
    Ok(labels)
}

/// Assigns each row to one of `folds` blocks of neighboring rows, in their order, sizes differing by at most
/// 1: folds for rows in the order of time.
///
/// # Errors
/// Those of [`assign_folds`].
pub fn assign_blocks(rows: usize, folds: usize) -> Result<Vec<usize>> {
    check_folds(rows, folds)?;
    Ok((0..rows)
        .map(|row| (row as u128 * folds as u128 / rows as u128) as usize)
        .collect())
}

/// Assigns each row to a fold, all rows of a group to the same one: the groups are divided as
/// [`assign_folds`] divides rows.
pub(super) fn assign_groups(groups: &[usize], folds: usize, seed: u64) -> Result<Vec<usize>> {
    let mut places: BTreeMap<usize, usize> = groups.iter().map(|&group| (group, 0)).collect();
    if folds < 2 || folds > places.len() {
        return Err(Error::Parameter {
            name: "folds",
            value: folds as f64,
            expected: "at least 2 and at most the number of groups",
        });
    }
    let of_groups = assign_folds(places.len(), folds, seed)?;
    for (fold, assigned) in places.values_mut().zip(of_groups) {
        *fold = assigned;
    }
    Ok(groups.iter().map(|group| places[group]).collect())
}

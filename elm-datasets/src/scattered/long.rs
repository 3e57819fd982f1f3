//! Tables with a row per wavelength, turned into tables with a column per wavelength.

use std::collections::HashMap;

use ndarray::Array2;

use crate::geometry::DirectionPair;
use crate::{Samples, channel};

/// Most wavelengths of a table: a column that has more values than this is none of wavelengths.
const MAX: usize = 1000;

/// What can be a wavelength, in nm: from a picometre to a metre.
const LENGTHS: std::ops::RangeInclusive<f64> = 1e-3..=1e9;

/// The samples of a table of which each row has a wavelength, shape (rows, 1): the first `column`
/// is its name. Wavelengths ascend; a pair of directions that lacks one has NaN there. The n-th
/// row of a pair and a wavelength belongs with the n-th of the pair's others.
///
/// # Errors
/// The row of a number that is no wavelength, or of one wavelength more than there can be.
pub(super) fn pivot(
    samples: &Samples,
    wavelengths: &[f64],
    column: &str,
) -> Result<Samples, (usize, f64)> {
    let largest = wavelengths.iter().copied().fold(0.0, f64::max);
    // One unit for the whole column: no optical wavelength is below 26 nm, and none above 25 um.
    let factor = channel::unit(column).unwrap_or(if largest <= 25.0 { 1000.0 } else { 1.0 });
    let nm = |wavelength: f64| factor * wavelength;
    let mut distinct: Vec<f64> = Vec::new();
    let mut places: HashMap<u64, usize> = HashMap::new();
    for (row, &wavelength) in wavelengths.iter().enumerate() {
        if !LENGTHS.contains(&nm(wavelength)) {
            return Err((row, wavelength));
        }
        places.entry(wavelength.to_bits()).or_insert_with(|| {
            distinct.push(wavelength);
            distinct.len() - 1
        });
        if distinct.len() > MAX {
            return Err((row, wavelength));
        }
    }
    let mut order: Vec<usize> = (0..distinct.len()).collect();
    order.sort_by(|&a, &b| distinct[a].total_cmp(&distinct[b]));
    let mut rank = vec![0; order.len()];
    for (to, &from) in order.iter().enumerate() {
        rank[from] = to;
    }

    // How often a pair has had a wavelength, and the row of each pair's n-th time.
    let mut times: HashMap<([u64; 6], usize), usize> = HashMap::new();
    let mut rows: HashMap<([u64; 6], usize), usize> = HashMap::new();
    let mut directions: Vec<DirectionPair> = Vec::new();
    let mut cells: Vec<(usize, usize, f64)> = Vec::with_capacity(wavelengths.len());
    for (row, (pair, wavelength)) in samples.directions.iter().zip(wavelengths).enumerate() {
        let (Some(&place), Some(&value)) = (
            places.get(&wavelength.to_bits()),
            samples.values.get((row, 0)),
        ) else {
            continue;
        };
        let ([a, b, c], [d, e, f]) = (pair.incident, pair.outgoing);
        // 0 and -0 are one number.
        let key = [a, b, c, d, e, f].map(|part| (part + 0.0).to_bits());
        let time = times.entry((key, place)).or_insert(0);
        let to = *rows.entry((key, *time)).or_insert_with(|| {
            directions.push(*pair);
            directions.len() - 1
        });
        *time += 1;
        cells.push((to, rank[place], value));
    }
    let mut values = Array2::from_elem((directions.len(), order.len()), f64::NAN);
    for (row, column, value) in cells {
        values[[row, column]] = value;
    }
    let lengths: Vec<f64> = order.iter().map(|&index| nm(distinct[index])).collect();
    Ok(Samples {
        directions,
        values,
        channels: names(&lengths).map_err(|found| (0, found))?,
    })
}

/// A name for each of these wavelengths, which ascend.
///
/// # Errors
/// One that is no different from the one before it.
fn names(lengths: &[f64]) -> Result<Vec<String>, f64> {
    // Digits that a conversion to nm adds say nothing, a thousandth of a picometre neither.
    let rounded: Vec<f64> = lengths.iter().map(|nm| (nm * 1e6).round() / 1e6).collect();
    let repeated = |lengths: &[f64]| {
        lengths
            .windows(2)
            .find(|two| two[0] >= two[1])
            .map(|two| two[1])
    };
    let lengths = match repeated(&rounded) {
        None => &rounded[..],
        Some(_) => lengths,
    };
    match repeated(lengths) {
        None => Ok(lengths.iter().map(|nm| format!("{nm} nm")).collect()),
        Some(found) => Err(found),
    }
}

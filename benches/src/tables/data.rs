//! Real tables in a folder, and how they are split.

use std::fs;
use std::path::Path;

use ndarray::{Array1, Array2, Axis, concatenate, s};

/// Training and test rows at most.
const MAX_ROWS: usize = 5000;

/// A regression table: inputs, and the target.
#[derive(Debug, Clone)]
pub struct RealTable {
    /// Its name.
    pub name: String,
    /// Shape (rows, inputs + 1), the target last.
    values: Array2<f64>,
}

/// Rows to fit and rows to judge, shape (rows, inputs + 1), the target last.
#[derive(Debug, Clone)]
pub struct Split {
    /// Three quarters of the rows, 5000 at most.
    pub train: Array2<f64>,
    /// Of the others 5000 at most.
    pub test: Array2<f64>,
}

/// Every `NAME_train.csv` in a folder with its `NAME_test.csv`, as one table each, by name; those that begin
/// with `class_` are for classification, and left out.
///
/// # Errors
/// A folder or file that cannot be read, or a folder without tables.
pub fn tables(folder: &Path, only: &str) -> Result<Vec<RealTable>, String> {
    let at = |error: std::io::Error| format!("{}: {error}", folder.display());
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).map_err(at)? {
        let name = entry
            .map_err(at)?
            .file_name()
            .to_string_lossy()
            .into_owned();
        if let Some(name) = name.strip_suffix("_train.csv")
            && !name.starts_with("class_")
            && name.contains(only)
        {
            names.push(name.to_owned());
        }
    }
    names.sort();
    if names.is_empty() {
        return Err(format!(
            "{}: no files named NAME_train.csv",
            folder.display()
        ));
    }
    names.into_iter().map(|name| read(folder, name)).collect()
}

fn read(folder: &Path, name: String) -> Result<RealTable, String> {
    let (train, test) = (
        numbers(folder, &name, "train")?,
        numbers(folder, &name, "test")?,
    );
    let values = concatenate(Axis(0), &[train.view(), test.view()])
        .map_err(|error| format!("{name}: {error}"))?;
    Ok(RealTable { name, values })
}

/// The rows of a file under its line of names, which need not differ: the last column is the target.
fn numbers(folder: &Path, name: &str, part: &str) -> Result<Array2<f64>, String> {
    let path = folder.join(format!("{name}_{part}.csv"));
    let at = |what: String| format!("{}: {what}", path.display());
    let text = fs::read_to_string(&path).map_err(|error| at(error.to_string()))?;
    let columns = text
        .lines()
        .next()
        .map_or(0, |names| names.split(',').count());
    let mut values = Vec::new();
    for (line, row) in text.lines().enumerate().skip(1) {
        for value in row.split(',') {
            let number: Result<f64, _> = value.trim().parse();
            values
                .push(number.map_err(|_| at(format!("line {}: not a number: {value}", line + 1)))?);
        }
    }
    let rows = values.len() / columns.max(1);
    Array2::from_shape_vec((rows, columns), values)
        .map_err(|_| at(format!("not {columns} numbers in every line")))
}

impl RealTable {
    /// Number of rows, and of inputs.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        (self.values.nrows(), self.values.ncols() - 1)
    }

    /// The split of this number: the same rows on every machine.
    #[must_use]
    pub fn split(&self, number: u64) -> Split {
        let rows = self.values.nrows();
        let mut order: Vec<usize> = (0..rows).collect();
        order.sort_by_key(|&row| scrambled((number << 32) + row as u64));
        let fitted = (rows * 3 / 4).min(MAX_ROWS);
        let judged = rows.min(fitted + MAX_ROWS);
        Split {
            train: self.values.select(Axis(0), &order[..fitted]),
            test: self.values.select(Axis(0), &order[fitted..judged]),
        }
    }
}

impl Split {
    /// Inputs and targets of the training rows.
    #[must_use]
    pub fn fitted(&self) -> (Array2<f64>, Array1<f64>) {
        divided(&self.train)
    }

    /// Inputs and targets of the test rows.
    #[must_use]
    pub fn judged(&self) -> (Array2<f64>, Array1<f64>) {
        divided(&self.test)
    }
}

fn divided(values: &Array2<f64>) -> (Array2<f64>, Array1<f64>) {
    let inputs = values.ncols() - 1;
    let x = values.slice(s![.., ..inputs]).to_owned();
    (x, values.column(inputs).to_owned())
}

/// SplitMix64's finaliser (Steele, Lea and Flood, Fast splittable pseudorandom number generators, 2014).
fn scrambled(number: u64) -> u64 {
    let z = number.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_split_divides_the_rows() {
        let values = Array2::from_shape_fn((41, 2), |(i, _)| i as f64);
        let name = "numbers".to_owned();
        let table = RealTable { name, values };
        let split = table.split(3);
        assert_eq!((split.train.nrows(), split.test.nrows()), (30, 11));
        let both = [split.fitted().1, split.judged().1].map(|t| t.to_vec());
        let mut all = both.concat();
        all.sort_by(f64::total_cmp);
        assert!(all.iter().enumerate().all(|(i, &t)| t == i as f64));
        assert_ne!(split.train, table.split(4).train);
    }
}

//! The Columbia-Utrecht reflectance database (CUReT): 61 materials at 205 pairs of directions.
//!
//! K. Dana, B. van Ginneken, S. Nayar, J. Koenderink, *Reflectance and Texture of Real-World
//! Surfaces*, ACM Transactions on Graphics 18(1), 1999. The files are the database's own and do
//! not come with this crate:
//!
//! - `table.txt`: per line the number of the measurement (1 to 205), then `theta_v phi_v theta_i
//!   phi_i` in radians, the viewer first.
//! - `abrdf.dat`: per line the number of the material (1 to 61), then 205 BRDF values in 1/sr,
//!   the mean of red, green and blue.
//! - `rbrdf.dat`, `gbrdf.dat`, `bbrdf.dat`: the same for one channel.
//!
//! [`read`] takes the three channels if all are there, and the mean otherwise; [`write()`] makes
//! such a folder; [`rig`] gives the directions from the geometry of the apparatus.

mod parse;
pub mod rig;
mod write;

use std::path::Path;

use ndarray::{Array2, ArrayViewMut1};

pub use crate::material_id::{MATERIALS, MaterialId, NAMES};
pub use write::write;

use crate::Error;
use crate::file;
use crate::geometry::DirectionPair;
use crate::measurements::{Invalid, Material, Measurements, Origin};

/// How many pairs of directions there are.
pub const MEASUREMENTS: usize = 205;

/// The file of the directions.
pub const TABLE: &str = "table.txt";

/// The files of the values: the mean of the channels, red, green and blue.
pub const VALUES: [&str; 4] = [AVERAGE[0].1, COLORS[0].1, COLORS[1].1, COLORS[2].1];

const AVERAGE: [(&str, &str); 1] = [("average", "abrdf.dat")];
const COLORS: [(&str, &str); 3] = [
    ("red", "rbrdf.dat"),
    ("green", "gbrdf.dat"),
    ("blue", "bbrdf.dat"),
];

/// Whether [`read`] would find its files in `dir`: the table and a complete set of values. Says
/// nothing of what is in them.
#[must_use]
pub fn is_present(dir: &Path) -> bool {
    dir.join(TABLE).is_file() && value_files(dir).is_ok()
}

/// The most telling complete set of channels in `dir`, as (channel, file) pairs.
fn value_files(dir: &Path) -> Result<&'static [(&'static str, &'static str)], Error> {
    let there = |&(_, file): &(&str, &str)| dir.join(file).is_file();
    if COLORS.iter().all(there) {
        Ok(&COLORS)
    } else if AVERAGE.iter().all(there) {
        Ok(&AVERAGE)
    } else {
        let found = COLORS
            .iter()
            .filter(|pair| there(pair))
            .map(|&(_, file)| file)
            .collect();
        Err(Error::NoValues {
            dir: dir.to_owned(),
            found,
        })
    }
}

/// Reads the materials `ids`, in that order, each once, from the CUReT files in `dir`.
///
/// The channels are red, green and blue if all three files are there, otherwise the average.
/// Of other materials' lines only the numbers are read. LF and CRLF line ends, blanks at the end
/// of a line and blank lines at the end of a file are all accepted, and the lines may come in any
/// order.
///
/// # Errors
/// - [`Error::NoValues`]: no complete set of value files; [`Error::Read`]: a file, `table.txt`
///   among them, cannot be read.
/// - [`Error::Count`], [`Error::NotANumber`], [`Error::NotUtf8`], [`Error::EntryNumber`],
///   [`Error::DuplicateEntry`], [`Error::MissingEntry`], [`Error::Angle`]: a file is damaged;
///   each names file and line.
pub fn read(dir: &Path, ids: &[MaterialId], invalid: Invalid) -> Result<Measurements, Error> {
    let files = value_files(dir)?;
    let path = dir.join(TABLE);
    let directions = parse::table(&path, &file::read(&path)?)?;
    let mut wanted: Vec<(MaterialId, Array2<f64>)> = Vec::new();
    for &id in ids {
        if wanted.iter().all(|&(other, _)| other != id) {
            wanted.push((id, Array2::zeros((MEASUREMENTS, files.len()))));
        }
    }
    for (channel, (_, name)) in files.iter().enumerate() {
        let path = dir.join(name);
        let mut columns: Vec<Option<ArrayViewMut1<'_, f64>>> = Vec::new();
        columns.resize_with(MATERIALS, || None);
        for (id, values) in &mut wanted {
            columns[id.index()] = Some(values.column_mut(channel));
        }
        parse::values(&path, &file::read(&path)?, |id| columns[id.index()].take())?;
    }
    let materials = wanted
        .into_iter()
        .map(|(id, values)| Material::new(id, id.name(), values, invalid))
        .collect();
    let channels: Vec<&str> = files.iter().map(|&(channel, _)| channel).collect();
    Ok(Measurements::new(
        Origin::Curet,
        directions,
        &channels,
        materials,
    ))
}

/// The directions in the bytes of a whole `table.txt`. `name` takes the place of the file in
/// errors.
///
/// # Errors
/// As for [`read`], of a damaged file.
pub fn parse_table(bytes: &[u8], name: impl AsRef<Path>) -> Result<Vec<DirectionPair>, Error> {
    parse::table(name.as_ref(), bytes)
}

/// The values in the bytes of a whole value file: shape (61 materials, 205 measurements). `name`
/// takes the place of the file in errors.
///
/// # Errors
/// As for [`read`], of a damaged file.
pub fn parse_values(bytes: &[u8], name: impl AsRef<Path>) -> Result<Array2<f64>, Error> {
    let mut values = Array2::zeros((MATERIALS, MEASUREMENTS));
    let mut rows: Vec<_> = values.rows_mut().into_iter().map(Some).collect();
    parse::values(name.as_ref(), bytes, |id| rows[id.index()].take())?;
    Ok(values)
}

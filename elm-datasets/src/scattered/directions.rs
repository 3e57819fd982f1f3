//! Tables of directions without values, and the same tables with values beside them.

use std::io;
use std::path::Path;

use ndarray::ArrayView2;

use super::angles::{Found, Reader};
use super::columns::Plan;
use super::dialect::Text;
use super::{Columns, Note, Options, unit};
use crate::csv::{Cells, Table, line_of};
use crate::geometry::DirectionPair;
use crate::{Error, file};

/// The directions of a table, row by row.
///
/// ```
/// use elm_datasets::scattered::{Columns, DirectionTable, Options};
/// use ndarray::array;
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let dir = tempfile::tempdir()?;
/// let path = dir.path().join("asked.csv");
/// std::fs::write(&path, "theta_i,phi_i,theta_o,phi_o\n0.5,0,0.25,3\n")?;
/// let table = DirectionTable::read(&path, &Options::default(), &Columns::default())?;
/// let mut out = Vec::new();
/// table.write(&mut out, &["grey".into()], array![[0.125]].view())?;
/// assert_eq!(out, b"theta_i,phi_i,theta_o,phi_o,grey\n0.5,0,0.25,3,0.125\n");
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct DirectionTable {
    /// The pair of each row. Of a row whose viewer is below the surface the viewer is on the lower
    /// side, where a reflectance is 0.
    pub pairs: Vec<DirectionPair>,
    /// What was assumed of the table.
    pub notes: Vec<Note>,
    /// Names of the columns of directions, as the table has them.
    names: Vec<String>,
    /// Their cells, as the table has them, row by row.
    cells: Vec<Vec<String>>,
}

impl DirectionTable {
    /// Reads the directions of a table as [`open`](crate::open()) does, and passes over all other columns.
    ///
    /// # Errors
    /// - Those of [`Table::read`] for what is no table of numbers.
    /// - [`Error::Scattered`] for directions that cannot be read, with the line and the
    ///   [`Problem`](super::Problem).
    pub fn read(
        path: impl AsRef<Path>,
        options: &Options,
        columns: &Columns,
    ) -> Result<Self, Error> {
        let path = path.as_ref();
        let bytes = file::read(path)?;
        let error = |line, problem| Error::Scattered {
            path: path.to_owned(),
            line,
            problem,
        };
        let text = Text::of(&bytes);
        let bytes = text.as_ref().map_or(bytes.as_slice(), |text| &text.bytes);
        let head = || line_of(bytes, 0);
        let names = Table::names(path, bytes)?;
        let plan = Plan::of_directions(&names, columns).map_err(|found| error(head(), found))?;
        let (table, begins) = Table::parse(path, bytes, |column| {
            if plan.directions.contains(column) {
                Cells::Numbers
            } else {
                Cells::Anything
            }
        })?;
        let (options, mut notes) =
            unit(text.as_ref(), &table, &plan, options).map_err(|found| error(head(), found))?;
        let mut reader = Reader::new(options.unit);
        let mut pairs = Vec::with_capacity(begins.len());
        let mut transmitted = 0;
        for (row, &begin) in table.values.rows().into_iter().zip(&begins) {
            let found = plan.directions.read(&mut reader, row);
            pairs.push(
                match found.map_err(|found| error(line_of(bytes, begin), found))? {
                    Found::Reflected(pair) => pair,
                    Found::Transmitted(_) => {
                        transmitted += 1;
                        DirectionPair {
                            incident: [0.0, 0.0, 1.0],
                            outgoing: [0.0, 0.0, -1.0],
                        }
                    }
                },
            );
        }
        notes.extend(reader.finish().map_err(|found| error(head(), found))?);
        if transmitted > 0 {
            notes.push(Note::BelowSurface {
                rows: transmitted,
                unit: options.unit,
            });
        }
        let kept: Vec<usize> = (0..names.len())
            .filter(|&column| plan.directions.contains(column))
            .collect();
        let cells = Table::cells(path, bytes, &kept)?;
        Ok(Self {
            pairs,
            notes,
            names: kept.iter().map(|&column| names[column].clone()).collect(),
            cells,
        })
    }

    /// Writes the columns of directions as they were read, with commas between, and those of `values`, shape
    /// (rows, channels), each number with as many digits as it takes to read back the same number.
    ///
    /// # Errors
    /// [`io::ErrorKind::InvalidInput`] unless there is a row of values for each pair, and a value for each
    /// channel; whatever `out` reports.
    pub fn write(
        &self,
        out: &mut dyn io::Write,
        channels: &[String],
        values: ArrayView2<'_, f64>,
    ) -> io::Result<()> {
        if values.dim() != (self.cells.len(), channels.len()) {
            return Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                format!(
                    "values have shape {:?}, expected {:?}",
                    values.dim(),
                    (self.cells.len(), channels.len())
                ),
            ));
        }
        let mut writer = ::csv::Writer::from_writer(out);
        writer.write_record(self.names.iter().chain(channels))?;
        for (cells, values) in self.cells.iter().zip(values.rows()) {
            let values: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
            writer.write_record(cells.iter().chain(&values))?;
        }
        writer.flush()
    }
}

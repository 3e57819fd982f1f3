//! Numeric tables with a header, from CSV.

use std::collections::HashSet;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use ::csv::{ErrorKind, Position, ReaderBuilder, StringRecord};
use ndarray::{Array2, Axis};

use crate::Error;
use crate::error::Column;
use crate::text::shorten;

/// A table of finite numbers with named columns: at least one of each.
///
/// ```
/// use elm_datasets::csv::Table;
///
/// let text = "width,height,price\n1,2,3\n4,5,6\n";
/// let table = Table::from_reader(text.as_bytes(), "boxes.csv")?;
/// let (inputs, targets) = table.split_target(&["price"])?;
/// assert_eq!((inputs.dim(), targets[[1, 0]]), ((2, 2), 6.0));
/// # Ok::<(), elm_datasets::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Distinct names, in the order of the columns.
    pub columns: Vec<String>,
    /// Shape (rows, columns).
    pub values: Array2<f64>,
}

impl Table {
    /// Reads a file: a line of names, then lines of numbers, with commas between.
    ///
    /// Blanks around names and numbers, quotes, CRLF and blank lines are accepted.
    ///
    /// # Errors
    /// - [`Error::Read`]: the file cannot be read.
    /// - [`Error::EmptyTable`]: no header or no rows; [`Error::NoHeader`]: the first line has
    ///   numbers only.
    /// - [`Error::UnnamedColumn`], [`Error::DuplicateColumn`]: names that name nothing, or two
    ///   columns.
    /// - [`Error::Count`]: a row of another length; [`Error::NotANumber`]: a cell that is no
    ///   finite number; [`Error::NotUtf8`], [`Error::Csv`]: no text or no CSV.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let file = File::open(path).map_err(|reason| Error::Read {
            path: path.to_owned(),
            reason,
        })?;
        Self::from_reader(file, path)
    }

    /// As [`read`](Self::read), from a stream. `name` takes the place of the file in errors.
    ///
    /// # Errors
    /// As for [`read`](Self::read).
    pub fn from_reader(mut stream: impl Read, name: impl AsRef<Path>) -> Result<Self, Error> {
        let path = name.as_ref();
        let mut bytes = Vec::new();
        stream
            .read_to_end(&mut bytes)
            .map_err(|reason| Error::Read {
                path: path.to_owned(),
                reason,
            })?;
        Self::parse(path, &bytes, |_| Cells::Numbers).map(|(table, _)| table)
    }

    /// The names of the columns alone.
    pub(crate) fn names(path: &Path, bytes: &[u8]) -> Result<Vec<String>, Error> {
        let source = Source { path, bytes };
        let mut reader = ReaderBuilder::new().has_headers(false).from_reader(bytes);
        let mut record = StringRecord::new();
        if reader
            .read_record(&mut record)
            .map_err(|reason| source.error(reason))?
        {
            header(source, &record)
        } else {
            Err(Error::EmptyTable {
                path: path.to_owned(),
                found: "nothing",
            })
        }
    }

    /// The text of the cells of these columns, row by row.
    pub(crate) fn cells(
        path: &Path,
        bytes: &[u8],
        columns: &[usize],
    ) -> Result<Vec<Vec<String>>, Error> {
        let source = Source { path, bytes };
        let reader = ReaderBuilder::new().has_headers(true).from_reader(bytes);
        let rows = reader.into_records().map(|record| {
            let record = record.map_err(|reason| source.error(reason))?;
            let cell = |&column: &usize| record.get(column).unwrap_or("").trim().to_owned();
            Ok(columns.iter().map(cell).collect())
        });
        rows.collect()
    }

    /// The table, and the byte at which the record of each row begins, for [`line_of`]. `cells_of`
    /// says what a column may hold, by its number.
    pub(crate) fn parse(
        path: &Path,
        bytes: &[u8],
        cells_of: impl Fn(usize) -> Cells,
    ) -> Result<(Self, Vec<u64>), Error> {
        let source = Source { path, bytes };
        // The header is read as a row, so that its place is known.
        let mut reader = ReaderBuilder::new()
            .has_headers(false)
            .from_reader(source.bytes);
        let mut record = StringRecord::new();
        let mut next = |record: &mut StringRecord| {
            reader
                .read_record(record)
                .map_err(|reason| source.error(reason))
        };
        if !next(&mut record)? {
            return Err(Error::EmptyTable {
                path: path.to_owned(),
                found: "nothing",
            });
        }
        let columns = header(source, &record)?;
        let (mut cells, mut begins) = (Vec::new(), Vec::new());
        while next(&mut record)? {
            begins.push(record.position().map_or(0, Position::byte));
            // The reader's own trimming would make a copy of every record.
            for (index, (cell, column)) in record.iter().map(str::trim).zip(&columns).enumerate() {
                let found = number(cell).or_else(|| cells_of(index).other(cell));
                cells.push(found.ok_or_else(|| Error::NotANumber {
                    path: path.to_owned(),
                    line: source.line(record.position()),
                    column: Column::Name(shorten(column)),
                    text: shorten(cell),
                })?);
            }
        }
        let rows = cells.len() / columns.len();
        match Array2::from_shape_vec((rows, columns.len()), cells) {
            Ok(values) if rows > 0 => Ok((Self { columns, values }, begins)),
            _ => Err(Error::EmptyTable {
                path: path.to_owned(),
                found: "only a header",
            }),
        }
    }

    /// Parts the columns into inputs and targets: the targets in the order named, shape (rows,
    /// names), and all others in the table's order, shape (rows, columns - names).
    ///
    /// # Errors
    /// - [`Error::UnknownColumn`]: a name that no column has.
    /// - [`Error::RepeatedTarget`]: a name given twice.
    /// - [`Error::Split`]: no names, or none left for the inputs.
    pub fn split_target(&self, names: &[&str]) -> Result<(Array2<f64>, Array2<f64>), Error> {
        let mut targets = Vec::with_capacity(names.len());
        // Names without a column are left out, should the public fields not fit together.
        let columns = self.columns.iter().take(self.values.ncols());
        for &name in names {
            match columns.clone().position(|column| column == name) {
                None => {
                    let columns = self.columns.clone();
                    return Err(Error::UnknownColumn {
                        name: shorten(name),
                        columns,
                    });
                }
                Some(index) if targets.contains(&index) => {
                    return Err(Error::RepeatedTarget {
                        name: name.to_owned(),
                    });
                }
                Some(index) => targets.push(index),
            }
        }
        let inputs: Vec<usize> = (0..self.values.ncols())
            .filter(|index| !targets.contains(index))
            .collect();
        if targets.is_empty() || inputs.is_empty() {
            let columns = self.values.ncols();
            return Err(Error::Split {
                targets: targets.len(),
                columns,
            });
        }
        Ok((
            self.values.select(Axis(1), &inputs),
            self.values.select(Axis(1), &targets),
        ))
    }
}

/// What is read, and what to call it in errors.
#[derive(Clone, Copy)]
struct Source<'a> {
    path: &'a Path,
    bytes: &'a [u8],
}

impl Source<'_> {
    fn line(self, position: Option<&Position>) -> usize {
        position.map_or(0, |position| line_of(self.bytes, position.byte()))
    }

    fn error(self, error: ::csv::Error) -> Error {
        let path = self.path.to_owned();
        let line = self.line(error.position());
        let whole = |count| usize::try_from(count).unwrap_or(usize::MAX);
        match error.into_kind() {
            ErrorKind::Io(reason) => Error::Read { path, reason },
            ErrorKind::Utf8 { .. } => Error::NotUtf8 { path, line },
            ErrorKind::UnequalLengths {
                expected_len, len, ..
            } => Error::Count {
                path,
                line,
                found: whole(len),
                expected: whole(expected_len),
            },
            // Seeking and serialising, which reading never does.
            _ => Error::Csv { path, line },
        }
    }
}

/// The line on which the record that begins at `byte` stands, counted from 1; 0 if unknown.
///
/// The reader's own count lags: it takes the rest of a CRLF and blank lines for the beginning of
/// the record that follows.
pub(crate) fn line_of(bytes: &[u8], byte: u64) -> usize {
    let Ok(byte) = usize::try_from(byte) else {
        return 0;
    };
    let after = bytes.iter().skip(byte);
    let blank = after
        .take_while(|byte| matches!(byte, b'\r' | b'\n'))
        .count();
    let before = bytes.iter().take(byte + blank);
    before.filter(|&&byte| byte == b'\n').count() + 1
}

/// The names of the columns, once they are seen to name them.
fn header(source: Source<'_>, record: &StringRecord) -> Result<Vec<String>, Error> {
    let names = || record.iter().map(str::trim);
    let (path, line) = (|| source.path.to_owned(), source.line(record.position()));
    if names().all(|name| name.parse::<f64>().is_ok()) {
        return Err(Error::NoHeader { path: path(), line });
    }
    let mut seen = HashSet::new();
    for (index, name) in names().enumerate() {
        if name.is_empty() {
            return Err(Error::UnnamedColumn {
                path: path(),
                line,
                column: index + 1,
            });
        }
        if !seen.insert(name) {
            return Err(Error::DuplicateColumn {
                path: path(),
                line,
                name: shorten(name),
            });
        }
    }
    Ok(names().map(str::to_owned).collect())
}

/// What the cells of a column may hold beside finite numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Cells {
    /// Nothing else.
    Numbers,
    /// What stands for a number that is missing.
    Missing,
    /// Anything.
    Anything,
}

impl Cells {
    /// NaN for a cell without a number that may be there.
    fn other(self, cell: &str) -> Option<f64> {
        const MISSING: [&str; 9] = [
            "", "nan", "na", "n/a", "null", "none", "inf", "infinity", "-",
        ];
        let missing = || {
            let word = cell.trim_start_matches(['+', '-']);
            let is = |text: &&str| text.eq_ignore_ascii_case(word);
            MISSING.iter().any(is) || cell.parse::<f64>().is_ok()
        };
        match self {
            Self::Numbers => None,
            Self::Missing => missing().then_some(f64::NAN),
            Self::Anything => Some(f64::NAN),
        }
    }
}

fn number(cell: &str) -> Option<f64> {
    cell.parse().ok().filter(|value: &f64| value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;
    use proptest::prelude::*;

    fn table(text: &[u8]) -> Result<Table, Error> {
        Table::from_reader(text, "some.csv")
    }

    #[test]
    fn a_table_is_read_whatever_its_blanks_quotes_and_line_ends() {
        let expected = Table {
            columns: vec!["a".into(), "b c".into()],
            values: array![[1.0, -2.5], [3e2, 0.0]],
        };
        for text in [
            "a,b c\n1,-2.5\n3e2,0\n",
            "a,b c\r\n1,-2.5\r\n3e2,0",
            " a ,\"b c\"\n\n 1 , -2.5 \n\"3e2\",+0\n\n",
            "\u{feff}a,b c\n1,-2.5\n3e2,0\n",
        ] {
            assert_eq!(table(text.as_bytes()).unwrap(), expected, "{text:?}");
        }
    }

    #[test]
    fn damage_is_reported_with_file_line_and_column() {
        for (text, fragments) in [
            ("", &["some.csv", "found nothing"] as &[&str]),
            ("\n\n", &["found nothing"]),
            ("a,b\n", &["some.csv", "found only a header"]),
            ("1,2\n3,4\n", &["line 1", "names", "numbers"]),
            ("a,b,a\n1,2,3\n", &["line 1", "\"a\" twice"]),
            ("a,,b\n1,2,3\n", &["line 1", "column 2", "no name"]),
            (
                "a,b\n1,2\n3\n",
                &["line 3", "expected 2 numbers", "found 1"],
            ),
            (
                "a,b\n1,2\n3,4,5\n",
                &["line 3", "expected 2 numbers", "found 3"],
            ),
            (
                "a,b\n1,2\n3,x\n",
                &["line 3", "column \"b\"", "finite number", "\"x\""],
            ),
            ("a,b\r\n1,2\r\n\r\n3,x\r\n", &["line 4", "column \"b\""]),
            ("a,b\r\n1\r\n", &["line 2", "found 1"]),
            ("\r\n\r\na,b,a\r\n", &["line 3", "twice"]),
            ("a,b\n,2\n", &["line 2", "column \"a\"", "\"\""]),
            ("a,b\n1,NaN\n", &["line 2", "column \"b\"", "\"NaN\""]),
            ("a,b\n1,-inf\n", &["line 2", "\"-inf\""]),
            ("a,b\n1,1e999\n", &["line 2", "\"1e999\""]),
        ] {
            let message = table(text.as_bytes()).unwrap_err().to_string();
            for fragment in fragments {
                assert!(
                    message.contains(fragment),
                    "{text:?}: no {fragment:?} in {message:?}"
                );
            }
            assert!(!message.contains('\n'), "{message}");
        }
        let error = table(b"a,b\n1,2\n3,\xff\n").unwrap_err();
        assert!(matches!(error, Error::NotUtf8 { line: 3, .. }), "{error}");
    }

    #[test]
    fn a_file_that_is_not_there_is_named() {
        let error = Table::read("no/such.csv").unwrap_err().to_string();
        assert!(error.starts_with("cannot read no/such.csv: "), "{error}");
    }

    #[test]
    fn targets_come_in_the_order_named_and_inputs_in_the_tables() {
        let table = table(b"a,b,c,d\n1,2,3,4\n5,6,7,8\n").unwrap();
        let (inputs, targets) = table.split_target(&["d", "b"]).unwrap();
        assert_eq!(inputs, array![[1.0, 3.0], [5.0, 7.0]]);
        assert_eq!(targets, array![[4.0, 2.0], [8.0, 6.0]]);
    }

    #[test]
    fn splits_that_cannot_be_made_are_errors() {
        let table = table(b"a,b\n1,2\n").unwrap();
        let error = table.split_target(&["y"]).unwrap_err().to_string();
        assert!(error.contains("\"y\"") && error.contains("a, b"), "{error}");
        let split = |names: &[&str]| table.split_target(names).unwrap_err();
        assert!(matches!(
            split(&[]),
            Error::Split {
                targets: 0,
                columns: 2
            }
        ));
        assert!(matches!(
            split(&["a", "b"]),
            Error::Split {
                targets: 2,
                columns: 2
            }
        ));
        assert!(matches!(split(&["a", "a"]), Error::RepeatedTarget { .. }));
    }

    proptest! {
        #[test]
        fn numbers_come_back_as_printed(rows in prop::collection::vec((-1e9..1e9, -1.0..1.0), 1..20)) {
            let mut text = "x,y\n".to_owned();
            for (x, y) in &rows {
                text.push_str(&format!("{x},{y}\n"));
            }
            let table = table(text.as_bytes()).unwrap();
            for (row, &(x, y)) in table.values.rows().into_iter().zip(&rows) {
                prop_assert_eq!((row[0], row[1]), (x, y));
            }
        }
    }
}

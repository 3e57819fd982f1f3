//! Parses CUReT's text files; an error names file, line and what was expected.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::path::Path;

use ndarray::ArrayViewMut1;

use super::{MATERIALS, MEASUREMENTS, MaterialId};
use crate::Error;
use crate::error::{Column, Entry};
use crate::geometry::{Angles, DirectionPair, NORMAL};
use crate::text::shorten;

/// The four angles in the order of `table.txt`: the viewer comes first.
const ANGLES: [&str; 4] = ["theta_o", "phi_o", "theta_i", "phi_i"];
const THETA_RANGE: &str = "in [0, pi/2)";
const PHI_RANGE: &str = "in [-2 pi, 2 pi]";

/// One line of a file.
#[derive(Clone, Copy)]
struct Line<'a> {
    path: &'a Path,
    number: usize,
    bytes: &'a [u8],
}

impl<'a> Line<'a> {
    fn text(self) -> Result<&'a str, Error> {
        std::str::from_utf8(self.bytes).map_err(|_| Error::NotUtf8 {
            path: self.path.to_owned(),
            line: self.number,
        })
    }

    /// The number of the entry that this line describes; the rest of the line is not looked at.
    fn entry_number(self, entry: Entry, last: usize) -> Result<usize, Error> {
        let first = self
            .bytes
            .split(u8::is_ascii_whitespace)
            .find(|word| !word.is_empty())
            .unwrap_or_default();
        let word = std::str::from_utf8(first).map_err(|_| Error::NotUtf8 {
            path: self.path.to_owned(),
            line: self.number,
        })?;
        match word.parse() {
            Ok(number) if (1..=last).contains(&number) => Ok(number),
            _ => Err(Error::EntryNumber {
                path: self.path.to_owned(),
                line: self.number,
                entry,
                last,
                text: shorten(word),
            }),
        }
    }

    /// The numbers after the first word, which must fill `values` exactly.
    fn values(self, mut values: ArrayViewMut1<'_, f64>) -> Result<(), Error> {
        let words = || self.text().map(|text| text.split_ascii_whitespace());
        let (found, expected) = (words()?.count(), values.len() + 1);
        if found != expected {
            let path = self.path.to_owned();
            return Err(Error::Count {
                path,
                line: self.number,
                found,
                expected,
            });
        }
        for (index, (value, word)) in values.iter_mut().zip(words()?.skip(1)).enumerate() {
            *value = finite(word).ok_or_else(|| Error::NotANumber {
                path: self.path.to_owned(),
                line: self.number,
                column: Column::Index(index + 2),
                text: shorten(word),
            })?;
        }
        Ok(())
    }
}

fn finite(word: &str) -> Option<f64> {
    word.parse().ok().filter(|value: &f64| value.is_finite())
}

/// Calls `each` with the index (number less one) of every line's entry, and sees to it that each
/// number occurs exactly once.
fn each_entry<'a>(
    path: &'a Path,
    bytes: &'a [u8],
    entry: Entry,
    last: usize,
    mut each: impl FnMut(usize, Line<'a>) -> Result<(), Error>,
) -> Result<(), Error> {
    let mut line_of = vec![None; last];
    let mut lines = 0;
    let bytes = bytes.trim_ascii_end();
    // Nothing would split into one empty line.
    let split = (!bytes.is_empty()).then(|| bytes.split(|&byte| byte == b'\n'));
    for (index, bytes) in split.into_iter().flatten().enumerate() {
        let line = Line {
            path,
            number: index + 1,
            bytes,
        };
        lines = line.number;
        let number = line.entry_number(entry, last)?;
        if let Some(first) = line_of[number - 1].replace(line.number) {
            let path = path.to_owned();
            return Err(Error::DuplicateEntry {
                path,
                line: line.number,
                first,
                entry,
                number,
            });
        }
        each(number - 1, line)?;
    }
    match line_of.iter().position(Option::is_none) {
        Some(index) => {
            let path = path.to_owned();
            Err(Error::MissingEntry {
                path,
                entry,
                number: index + 1,
                last,
                lines,
            })
        }
        None => Ok(()),
    }
}

/// The bytes of `table.txt` as directions, in the order of their numbers.
pub(super) fn table(path: &Path, bytes: &[u8]) -> Result<Vec<DirectionPair>, Error> {
    let unset = DirectionPair {
        incident: NORMAL,
        outgoing: NORMAL,
    };
    let mut directions = vec![unset; MEASUREMENTS];
    each_entry(
        path,
        bytes,
        Entry::Measurement,
        MEASUREMENTS,
        |index, line| {
            let mut angles = [0.0; 4];
            line.values(ArrayViewMut1::from(&mut angles))?;
            let [theta_o, phi_o, theta_i, phi_i] = angles;
            let found = Angles {
                theta_i,
                phi_i,
                theta_o,
                phi_o,
            };
            check_angles(&found).map_err(
                |Wrong {
                     angle,
                     value,
                     expected,
                 }| Error::Angle {
                    path: path.to_owned(),
                    line: line.number,
                    angle,
                    value,
                    expected,
                },
            )?;
            directions[index] = found.into();
            Ok(())
        },
    )?;
    Ok(directions)
}

/// An angle out of range.
pub(super) struct Wrong {
    pub(super) angle: &'static str,
    pub(super) value: f64,
    pub(super) expected: &'static str,
}

/// Both polar angles above the horizon, both azimuths within a turn; NaN is out of range.
pub(super) fn check_angles(directions: &Angles) -> Result<(), Wrong> {
    let Angles {
        theta_i,
        phi_i,
        theta_o,
        phi_o,
    } = *directions;
    for (angle, value) in ANGLES.into_iter().zip([theta_o, phi_o, theta_i, phi_i]) {
        let (good, expected) = if angle.starts_with("theta") {
            ((0.0..FRAC_PI_2).contains(&value), THETA_RANGE)
        } else {
            ((-TAU..=TAU).contains(&value), PHI_RANGE)
        };
        if !good {
            return Err(Wrong {
                angle,
                value,
                expected,
            });
        }
    }
    Ok(())
}

/// Reads from the bytes of a value file the materials for which `place` gives a column of 205
/// values to fill, and only the number of every other line.
pub(super) fn values<'v>(
    path: &Path,
    bytes: &[u8],
    mut place: impl FnMut(MaterialId) -> Option<ArrayViewMut1<'v, f64>>,
) -> Result<(), Error> {
    each_entry(
        path,
        bytes,
        Entry::Material,
        MATERIALS,
        |index, line| match place(MaterialId::new(index + 1)?) {
            Some(column) => line.values(column),
            None => Ok(()),
        },
    )
}

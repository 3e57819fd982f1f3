//! Writes files in CUReT's layout.

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::path::Path;

use super::parse::{Wrong, check_angles};
use super::{AVERAGE, COLORS, MATERIALS, MEASUREMENTS, MaterialId, TABLE};
use crate::error::Layout;
use crate::geometry::{Angles, DirectionPair};
use crate::{Error, Material, Measurements};

/// Writes `table.txt` and the value files of the channels into `dir`, in CUReT's layout: angles
/// with six decimals, values with three. What the database has [`read`](super::read) (negative
/// values kept) comes out as the same bytes.
///
/// The folder is made if it is not there. Each file is written beside its place and then moved
/// there, the table last, so that [`is_present`](super::is_present) never sees half a set where
/// there was none. Value files of other channels that are in the folder already stay.
///
/// # Errors
/// [`Error::Layout`] unless there are 205 pairs of directions in range, the channels are
/// `average`, or `red`, `green` and `blue`, and all 61 materials occur once with all rows and
/// finite values; [`Error::Write`] if the file system refuses.
pub fn write(dir: &Path, measurements: &Measurements) -> Result<(), Error> {
    check_directions(&measurements.directions)?;
    let files = files(&measurements.channels)?;
    let materials = in_order(measurements)?;
    for (channel, (_, file)) in files.iter().enumerate() {
        save(dir, file, &values_text(&materials, channel))?;
    }
    save(dir, TABLE, &table_text(&measurements.directions))
}

fn check_directions(directions: &[DirectionPair]) -> Result<(), Layout> {
    if directions.len() != MEASUREMENTS {
        return Err(Layout::Directions {
            found: directions.len(),
            expected: MEASUREMENTS,
        });
    }
    for (index, pair) in directions.iter().enumerate() {
        check_angles(&Angles::of(pair)).map_err(
            |Wrong {
                 angle,
                 value,
                 expected,
             }| Layout::Angle {
                measurement: index + 1,
                angle,
                value,
                expected,
            },
        )?;
    }
    Ok(())
}

fn files(channels: &[String]) -> Result<&'static [(&'static str, &'static str)], Layout> {
    [COLORS.as_slice(), AVERAGE.as_slice()]
        .into_iter()
        .find(|files| {
            files
                .iter()
                .map(|&(channel, _)| channel)
                .eq(channels.iter())
        })
        .ok_or_else(|| Layout::Channels(channels.to_vec()))
}

/// The materials by number, each checked for shape and values.
fn in_order(measurements: &Measurements) -> Result<Vec<&Material>, Layout> {
    MaterialId::all()
        .map(|id| {
            let mut same = measurements
                .materials
                .iter()
                .filter(|material| material.id == id);
            match (same.next(), same.count()) {
                (Some(material), 0) => {
                    check_values(material, measurements.channels.len())?;
                    Ok(material)
                }
                (first, others) => Err(Layout::Materials {
                    number: id.number(),
                    count: others + usize::from(first.is_some()),
                    last: MATERIALS,
                }),
            }
        })
        .collect()
}

fn check_values(material: &Material, channels: usize) -> Result<(), Layout> {
    let number = material.id.number();
    let shape = material.values.dim();
    if !material.rows.iter().copied().eq(0..MEASUREMENTS) || shape != (MEASUREMENTS, channels) {
        let (rows, expected) = (material.rows.len(), MEASUREMENTS);
        return Err(Layout::Rows {
            number,
            rows,
            shape,
            expected,
        });
    }
    match material
        .values
        .indexed_iter()
        .find(|(_, value)| !value.is_finite())
    {
        Some(((row, _), &value)) => Err(Layout::NotFinite {
            number,
            measurement: row + 1,
            value,
        }),
        None => Ok(()),
    }
}

/// As the database has it: CRLF between the lines, none after the last.
fn table_text(directions: &[DirectionPair]) -> String {
    let lines: Vec<String> = directions
        .iter()
        .enumerate()
        .map(|(index, pair)| {
            let angles = Angles::of(pair);
            format!(
                "{:<6}{:.6}   {:>9}   {:.6}   {:>9}",
                index + 1,
                angles.theta_o,
                azimuth(angles.phi_o),
                angles.theta_i,
                azimuth(angles.phi_i)
            )
        })
        .collect();
    lines.join("\r\n")
}

/// Half a turn is positive in the database, where its six decimals are a little more than pi.
fn azimuth(phi: f64) -> String {
    const ROUNDING: f64 = 1e-6;
    let turned = if phi < ROUNDING - PI { phi + TAU } else { phi };
    format!("{turned:.6}")
}

/// As the database has it: LF after every line, and a blank before it.
fn values_text(materials: &[&Material], channel: usize) -> String {
    let mut text = String::new();
    for material in materials {
        // Writing to a string cannot fail.
        let _ = write!(text, "{:<2}", material.id.number());
        for value in material.values.column(channel) {
            let _ = write!(text, "  {value:>6.3}");
        }
        text.push_str(" \n");
    }
    text
}

fn save(dir: &Path, file: &str, text: &str) -> Result<(), Error> {
    crate::file::replace(&dir.join(file), |out| out.write_all(text.as_bytes()))
}

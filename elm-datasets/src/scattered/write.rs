//! Samples as a table that is read back bit for bit.

use std::io::{self, Write};
use std::path::Path;

use ndarray::Array2;

use super::columns::Plan;
use super::{Columns, names};
use crate::error::scattered::{ANGLES, AngleUnit, Problem};
use crate::geometry::{Angles, DirectionPair};
use crate::text::shorten;
use crate::{Error, Samples, file};

/// Writes samples as angles in radians and their values, each number with as many digits as it
/// takes to read back the same number. The file comes into place in one step.
///
/// # Errors
/// - [`Error::Scattered`], before anything is written, for samples that [`read`](super::read) would
///   refuse: the [`Problem`] with the line that it would have been on.
/// - [`Error::Write`] if the file system refuses.
pub fn write(path: impl AsRef<Path>, samples: &Samples) -> Result<(), Error> {
    let path = path.as_ref();
    check(path, samples)?;
    file::replace(path, |out| write_checked(out, samples))
}

/// As [`write()`], to a stream. `name` takes the place of the file in errors.
///
/// # Errors
/// As for [`write()`].
pub fn to_writer(
    mut stream: impl Write,
    name: impl AsRef<Path>,
    samples: &Samples,
) -> Result<(), Error> {
    let path = name.as_ref();
    check(path, samples)?;
    write_checked(&mut stream, samples).map_err(|reason| Error::Write {
        path: path.to_owned(),
        reason,
    })
}

fn write_checked(out: &mut dyn Write, samples: &Samples) -> io::Result<()> {
    let mut writer = ::csv::Writer::from_writer(out);
    let channels = samples.channels.iter().map(String::as_str);
    writer.write_record(ANGLES.into_iter().chain(channels))?;
    for (pair, values) in samples.directions.iter().zip(samples.values.rows()) {
        let angles = Angles::of(pair).to_array();
        let numbers = angles.into_iter().chain(values.iter().copied());
        writer.write_record(numbers.map(|number| format!("{number:?}")))?;
    }
    writer.flush()
}

/// Refuses what `read` would refuse.
fn check(path: &Path, samples: &Samples) -> Result<(), Error> {
    check_samples(samples).map_err(|(line, problem)| Error::Scattered {
        path: path.to_owned(),
        line,
        problem,
    })
}

/// What `read` would refuse, with its line.
fn check_samples(samples: &Samples) -> Result<(), (usize, Problem)> {
    let Samples {
        directions,
        values,
        channels,
    } = samples;
    let (rows, columns) = values.dim();
    if rows != directions.len() || columns != channels.len() {
        let problem = Problem::Shape {
            directions: directions.len(),
            names: channels.len(),
            shape: values.dim(),
        };
        return Err((1, problem));
    }
    if rows == 0 || columns == 0 {
        return Err((1, Problem::NoValues));
    }
    for (index, name) in channels.iter().enumerate() {
        let again = channels[..index].contains(name);
        // The reader trims names.
        if again || name.is_empty() || name.trim() != name || names::of(name).is_some() {
            let name = shorten(name);
            return Err((1, Problem::ChannelName { name }));
        }
    }
    let header: Vec<String> = ANGLES
        .map(str::to_owned)
        .into_iter()
        .chain(channels.iter().cloned())
        .collect();
    let plan = Plan::new(&header, &Columns::default()).map_err(|problem| (1, problem))?;
    if plan.wavelength.is_some() {
        let name = shorten(channels.first().map_or("", String::as_str));
        return Err((1, Problem::ChannelName { name }));
    }
    for (row, pair) in directions.iter().enumerate() {
        let line = row + 2;
        check_row(pair, values, row, channels).map_err(|problem| (line, problem))?;
    }
    Ok(())
}

fn check_row(
    pair: &DirectionPair,
    values: &Array2<f64>,
    row: usize,
    channels: &[String],
) -> Result<(), Problem> {
    let names = ANGLES
        .into_iter()
        .chain(channels.iter().map(String::as_str));
    let angles = Angles::of(pair);
    let numbers = angles
        .to_array()
        .into_iter()
        .chain(values.row(row).to_vec());
    for (column, found) in names.zip(numbers) {
        if !found.is_finite() {
            let column = shorten(column);
            return Err(Problem::NotFinite { column, found });
        }
    }
    for (angle, found) in [("theta_i", angles.theta_i), ("theta_o", angles.theta_o)] {
        // What the reader would take for another number, or leave out.
        if !(0.0..=std::f64::consts::FRAC_PI_2).contains(&found) {
            let unit = AngleUnit::Radians;
            return Err(Problem::PolarAngle { angle, unit, found });
        }
    }
    Ok(())
}

//! Tables to files, whole or not at all.

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use datafusion::arrow::array::RecordBatch;
use datafusion::arrow::csv;
use datafusion::arrow::datatypes::SchemaRef;
use datafusion::arrow::error::ArrowError;
use datafusion::arrow::ipc::writer::FileWriter;
use datafusion::arrow::json::LineDelimitedWriter;
use datafusion::dataframe::DataFrame;
use futures::StreamExt;
use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::file::properties::WriterProperties;
use tempfile::NamedTempFile;

use crate::failure::Failure;
use crate::files::Kind;

/// Where bytes go: a file beside the target until all is written, or a device.
enum Place {
    Beside(NamedTempFile),
    Device(File),
}

impl Write for Place {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Beside(file) => file.write(bytes),
            Self::Device(file) => file.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Beside(file) => file.flush(),
            Self::Device(file) => file.flush(),
        }
    }
}

enum Writer {
    Csv(Box<csv::Writer<BufWriter<Place>>>),
    Json(Box<LineDelimitedWriter<BufWriter<Place>>>),
    Arrow(Box<FileWriter<BufWriter<Place>>>),
    Parquet(Box<ArrowWriter<BufWriter<Place>>>),
}

/// A table that is being written.
pub(crate) struct Output {
    path: PathBuf,
    writer: Writer,
}

impl Output {
    /// Begins a file of the kind that its name asks for.
    pub(crate) fn create(path: &Path, schema: &SchemaRef) -> Result<Self, Failure> {
        let kind = Kind::of(&path.to_string_lossy())?;
        let place = place(path).map_err(|reason| unwritable(path, &reason))?;
        let to = BufWriter::new(place);
        let made = || -> Result<Writer, ArrowError> {
            Ok(match kind {
                Kind::Csv => Writer::Csv(Box::new(csv::Writer::new(to))),
                Kind::Json => Writer::Json(Box::new(LineDelimitedWriter::new(to))),
                Kind::Arrow => Writer::Arrow(Box::new(FileWriter::try_new(to, schema)?)),
                Kind::Parquet => {
                    let properties = WriterProperties::builder()
                        .set_compression(Compression::SNAPPY)
                        .build();
                    let writer =
                        ArrowWriter::try_new(to, SchemaRef::clone(schema), Some(properties))?;
                    Writer::Parquet(Box::new(writer))
                }
            })
        };
        let writer = made().map_err(|reason| unwritable(path, &reason))?;
        Ok(Self {
            path: path.to_owned(),
            writer,
        })
    }

    pub(crate) fn write(&mut self, batch: &RecordBatch) -> Result<(), Failure> {
        let written: Result<(), ArrowError> = match &mut self.writer {
            Writer::Csv(writer) => writer.write(batch),
            Writer::Json(writer) => writer.write(batch),
            Writer::Arrow(writer) => writer.write(batch),
            Writer::Parquet(writer) => writer.write(batch).map_err(ArrowError::from),
        };
        written.map_err(|reason| unwritable(&self.path, &reason))
    }

    /// Puts the file in its place.
    pub(crate) fn finish(self) -> Result<(), Failure> {
        let path = self.path;
        let finished = || -> Result<(), ArrowError> {
            let to = match self.writer {
                Writer::Csv(writer) => writer.into_inner(),
                Writer::Json(mut writer) => {
                    writer.finish()?;
                    writer.into_inner()
                }
                Writer::Arrow(mut writer) => {
                    writer.finish()?;
                    writer.into_inner()?
                }
                Writer::Parquet(writer) => writer.into_inner()?,
            };
            match to.into_inner().map_err(io::IntoInnerError::into_error)? {
                Place::Beside(file) => {
                    file.as_file().sync_all()?;
                    file.persist(&path).map_err(|error| error.error)?;
                }
                Place::Device(mut file) => file.flush()?,
            }
            Ok(())
        };
        finished().map_err(|reason| unwritable(&path, &reason))
    }
}

fn place(path: &Path) -> io::Result<Place> {
    if path
        .metadata()
        .is_ok_and(|there| !there.is_file() && !there.is_dir())
    {
        return Ok(Place::Device(OpenOptions::new().write(true).open(path)?));
    }
    if path.is_dir() {
        return Err(io::Error::from(io::ErrorKind::IsADirectory));
    }
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".elm-").suffix(".tmp");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    // Its error names the temporary file, which says nothing to the user.
    let file = builder
        .tempfile_in(folder)
        .map_err(|error| match error.raw_os_error() {
            Some(code) => io::Error::from_raw_os_error(code),
            None => io::Error::from(error.kind()),
        })?;
    Ok(Place::Beside(file))
}

fn unwritable(path: &Path, reason: &dyn std::fmt::Display) -> Failure {
    Failure::at(format!("cannot write {}", path.display()), reason)
}

/// Writes the rows of a query batch by batch; returns how many there were.
pub(crate) async fn save(rows: DataFrame, path: &Path) -> Result<usize, Failure> {
    let schema = SchemaRef::clone(rows.schema().inner());
    let mut output = Output::create(path, &schema)?;
    let mut batches = rows.execute_stream().await?;
    let mut count = 0;
    while let Some(batch) = batches.next().await {
        let batch = batch?;
        count += batch.num_rows();
        output.write(&batch)?;
    }
    output.finish()?;
    Ok(count)
}

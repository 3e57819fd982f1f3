//! Tables from files.

use std::path::Path;

use datafusion::arrow::datatypes::{DataType, SchemaRef};
use datafusion::dataframe::DataFrame;
use datafusion::datasource::listing::ListingTableUrl;
use datafusion::execution::object_store::ObjectStoreUrl;
use datafusion::execution::options::ArrowReadOptions;
use datafusion::prelude::{CsvReadOptions, JsonReadOptions, ParquetReadOptions, SessionContext};

use crate::failure::Failure;
use crate::stores;

/// Kinds of files, by the end of their names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Csv,
    Parquet,
    Json,
    Arrow,
}

impl Kind {
    pub(crate) fn of(path: &str) -> Result<Self, Failure> {
        match extension(path).to_ascii_lowercase().as_str() {
            "csv" => Ok(Self::Csv),
            "parquet" => Ok(Self::Parquet),
            "json" | "jsonl" | "ndjson" => Ok(Self::Json),
            "arrow" | "ipc" | "feather" => Ok(Self::Arrow),
            _ => Err(Failure::at(
                path,
                "expected a name that ends in .csv, .parquet, .json, .jsonl, .ndjson, .arrow, .ipc or .feather",
            )),
        }
    }
}

fn extension(path: &str) -> &str {
    let extension = Path::new(path)
        .extension()
        .and_then(|extension| extension.to_str());
    extension.unwrap_or_default()
}

/// The files that names, patterns and URLs stand for, in order.
async fn expand(context: &SessionContext, patterns: &[String]) -> Result<Vec<String>, Failure> {
    let mut files = Vec::new();
    for pattern in patterns {
        if stores::is_url(pattern) {
            files.extend(stores::list(context, pattern).await?);
            continue;
        }
        if Path::new(pattern).is_file() {
            files.push(pattern.clone());
            continue;
        }
        let paths = glob::glob(pattern).map_err(|error| Failure::at(pattern, error))?;
        let before = files.len();
        for path in paths {
            let path = path.map_err(|error| Failure::at(pattern, error))?;
            if path.is_file() {
                files.push(path.to_string_lossy().into_owned());
            }
        }
        if files.len() == before {
            return Err(Failure::at(pattern, "no such file"));
        }
    }
    Ok(files)
}

/// The store that a file is in.
fn root(path: &str) -> Result<ObjectStoreUrl, Failure> {
    let url = ListingTableUrl::parse(path);
    let url = url.map_err(|reason| Failure::at(path, Failure::from(reason)))?;
    Ok(url.object_store())
}

async fn read(
    context: &SessionContext,
    kind: Kind,
    files: Vec<String>,
) -> Result<DataFrame, Failure> {
    let end = extension(files.first().map_or("", String::as_str)).to_owned();
    let table = match kind {
        Kind::Csv => {
            context
                .read_csv(files, CsvReadOptions::new().file_extension(&end))
                .await
        }
        Kind::Parquet => {
            context
                .read_parquet(files, ParquetReadOptions::new().file_extension(&end))
                .await
        }
        Kind::Json => {
            context
                .read_json(files, JsonReadOptions::default().file_extension(&end))
                .await
        }
        Kind::Arrow => {
            let options = ArrowReadOptions {
                file_extension: &end,
                ..ArrowReadOptions::default()
            };
            context.read_arrow(files, options).await
        }
    };
    Ok(table?)
}

/// A table of one or more files.
pub(crate) struct Table {
    pub(crate) rows: DataFrame,
    files: Vec<(String, SchemaRef)>,
}

impl Table {
    pub(crate) async fn open(
        context: &SessionContext,
        patterns: &[String],
    ) -> Result<Self, Failure> {
        let paths = expand(context, patterns).await?;
        let first = paths.first().map_or("", String::as_str);
        let kind = Kind::of(first)?;
        let mut files = Vec::new();
        for path in &paths {
            if extension(path) != extension(first) {
                let reason = format!(
                    "expected a file that ends in .{}, as the first",
                    extension(first)
                );
                return Err(Failure::at(path, reason));
            }
            if root(path)? != root(first)? {
                let reason = format!("expected a file from the same store as {first}");
                return Err(Failure::at(path, reason));
            }
            let rows = read(context, kind, vec![path.clone()]).await;
            let rows = rows.map_err(|failure| Failure::at(path, failure))?;
            files.push((path.clone(), SchemaRef::clone(rows.schema().inner())));
        }
        let rows = read(context, kind, paths).await?;
        Ok(Self { rows, files })
    }

    /// The names of all columns.
    pub(crate) fn names(&self) -> Vec<String> {
        self.rows
            .schema()
            .fields()
            .iter()
            .map(|field| field.name().clone())
            .collect()
    }

    /// The type of a column that every file must have, as numbers or as text alike. A file without it would
    /// give NULLs.
    pub(crate) fn column(&self, name: &str) -> Result<&DataType, Failure> {
        let mut first: Option<(&str, &DataType)> = None;
        for (path, schema) in &self.files {
            let field = schema.field_with_name(name).map_err(|_| {
                let names: Vec<&str> = schema.fields().iter().map(|f| f.name().as_str()).collect();
                let found = brief(&names);
                Failure::at(path, format!("no column '{name}'; its columns are {found}"))
            })?;
            let found = field.data_type();
            match first {
                None => first = Some((path, found)),
                Some((other, expected)) if is_text(expected) != is_text(found) => {
                    let reason = format!("column '{name}' is {found}; it is {expected} in {other}");
                    return Err(Failure::at(path, reason));
                }
                Some(_) => {}
            }
        }
        let (_, data_type) = first.ok_or_else(|| Failure::new("no files"))?;
        Ok(data_type)
    }
}

fn brief(names: &[&str]) -> String {
    const MOST: usize = 20;
    if names.len() <= MOST {
        return names.join(", ");
    }
    format!("{}, ... ({} in all)", names[..MOST].join(", "), names.len())
}

pub(crate) fn is_text(data_type: &DataType) -> bool {
    match data_type {
        DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View => true,
        DataType::Dictionary(_, values) => is_text(values),
        _ => false,
    }
}

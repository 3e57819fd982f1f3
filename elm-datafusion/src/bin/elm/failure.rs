//! What the program ends with when it cannot do what it was asked.

use std::fmt;

use datafusion::error::DataFusionError;

/// One line that says what is wrong and where.
#[derive(Debug)]
pub(crate) struct Failure(String);

impl Failure {
    pub(crate) fn new(message: impl Into<String>) -> Self {
        Self(message.into())
    }

    /// With what was being read or done.
    pub(crate) fn at(place: impl fmt::Display, reason: impl fmt::Display) -> Self {
        Self(format!("{place}: {reason}"))
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl From<DataFusionError> for Failure {
    fn from(error: DataFusionError) -> Self {
        // The planner wraps what a function says of its arguments, and adds lines on its types.
        let text = error.strip_backtrace();
        let own = ["elm_fit", "elm_predict", "elm_sample"];
        let own = own
            .iter()
            .filter_map(|name| text.rfind(&format!("planning: {name}")));
        let start = own.max().map_or(0, |at| at + "planning: ".len());
        let line = text[start..].lines().next().unwrap_or_default();
        let line = line.split(". No function matches").next().unwrap_or(line);
        // What other processes answer is wrapped in the types that it came through.
        let wrapped = [
            ("message: \"", "\", metadata"),
            ("message: \"", "\", source"),
            ("GrpcConnectionError(\"", ": tonic"),
        ];
        let inner = wrapped
            .iter()
            .find_map(|(start, end)| between(line, start, end));
        Self(inner.unwrap_or(line).to_owned())
    }
}

fn between<'a>(text: &'a str, start: &str, end: &str) -> Option<&'a str> {
    let (_, rest) = text.split_once(start)?;
    Some(rest.rsplit_once(end)?.0)
}

impl From<datafusion::arrow::error::ArrowError> for Failure {
    fn from(error: datafusion::arrow::error::ArrowError) -> Self {
        Self(error.to_string())
    }
}

impl From<elm::Error> for Failure {
    fn from(error: elm::Error) -> Self {
        Self(error.to_string())
    }
}

impl From<elm::persist::Error> for Failure {
    fn from(error: elm::persist::Error) -> Self {
        Self(error.to_string())
    }
}

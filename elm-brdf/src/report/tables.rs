//! The report as Tables I to III, for a terminal or a document.

use std::fmt::Write;

use comfy_table::{CellAlignment, Table, presets};

use super::{Channel, Paper, Report};
use crate::protocol::Metrics;

/// Where a table is to be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Style {
    Text,
    Markdown,
}

/// One of the paper's three tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Measure {
    Rmse,
    Mae,
    Correlation,
}

impl Measure {
    pub(super) const ALL: [Self; 3] = [Self::Rmse, Self::Mae, Self::Correlation];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Rmse => "rmse",
            Self::Mae => "mae",
            Self::Correlation => "correlation",
        }
    }

    fn title(self) -> &'static str {
        match self {
            Self::Rmse => "Table I: root mean squared error (BRDF in 1/sr)",
            Self::Mae => "Table II: mean absolute error (BRDF in 1/sr)",
            Self::Correlation => "Table III: correlation",
        }
    }

    pub(super) fn of(self, metrics: &Metrics) -> Option<f64> {
        match self {
            Self::Rmse => Some(metrics.rmse),
            Self::Mae => Some(metrics.mae),
            Self::Correlation => metrics.correlation,
        }
    }

    pub(super) fn printed(self, paper: &Paper) -> Option<f64> {
        match self {
            Self::Rmse => Some(paper.rmse),
            Self::Mae => paper.mae,
            Self::Correlation => paper.correlation,
        }
    }

    fn is_misprint(self, paper: &Paper) -> bool {
        self == Self::Mae && paper.impossible_mae
    }

    /// Held out over printed; none where the printed figure is missing or impossible.
    pub(super) fn ratio(self, channel: &Channel) -> Option<f64> {
        let paper = channel.paper.filter(|paper| !self.is_misprint(paper))?;
        Some(self.of(&channel.held_out)? / self.printed(&paper)?)
    }
}

pub(super) fn render(report: &Report, style: Style) -> String {
    let mut out = String::new();
    let compared = report
        .materials
        .iter()
        .flat_map(|m| &m.channels)
        .any(|c| c.paper.is_some());
    heading(&mut out, report, style);
    for measure in Measure::ALL {
        let mark = if style == Style::Markdown { "### " } else { "" };
        let suffix = if report.data.synthetic {
            ", SYNTHETIC stand-in data"
        } else {
            ""
        };
        push(
            &mut out,
            format_args!("\n{mark}{}{suffix}\n", measure.title()),
        );
        if style == Style::Markdown {
            out.push('\n');
        }
        push(
            &mut out,
            format_args!("{}\n", trim(&table(report, measure, compared, style))),
        );
    }
    summary(&mut out, report, style, compared);
    out
}

fn heading(out: &mut String, report: &Report, style: Style) {
    let (data, protocol) = (&report.data, &report.protocol);
    if style == Style::Markdown {
        out.push_str("## Extreme learning machines on measured reflectance\n\n");
    }
    let item = if style == Style::Markdown { "- " } else { "" };
    if data.synthetic {
        push(
            out,
            format_args!(
                "{item}SYNTHETIC stand-in data, not measurements: no CUReT files were found, so there \
             is nothing to compare with the paper.\n"
            ),
        );
    }
    push(out, format_args!("{item}Data: {}\n", data.source));
    push(
        out,
        format_args!(
            "{item}{} materials x {} directions, channels: {}; negative values met: {}\n",
            data.materials,
            data.measurements,
            data.channels.join(", "),
            data.invalid,
        ),
    );
    push(
        out,
        format_args!(
            "{item}Model: {} ({} inputs, {} target), {} {} neurons, {}; {}-fold cross-validation, \
         seed {}\n",
            protocol.model,
            protocol.features,
            protocol.target,
            protocol.neurons,
            protocol.activation,
            protocol.solver,
            protocol.folds,
            protocol.seed,
        ),
    );
}

fn table(report: &Report, measure: Measure, compared: bool, style: Style) -> String {
    let mut table = styled(style);
    let mut header = vec!["material", "channel", "train", "held out", "fold mean"];
    if compared {
        header.extend(["paper", "held out / paper"]);
    }
    let columns = header.len();
    table.set_header(header);
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.4}"));
    for material in &report.materials {
        for channel in &material.channels {
            let mut row = vec![
                format!("{:>2} {}", material.id, material.name),
                channel.channel.clone(),
                number(measure.of(&channel.train)),
                number(measure.of(&channel.held_out)),
                number(measure.of(&channel.held_out_fold_mean)),
            ];
            if compared {
                let paper = channel.paper;
                let star = paper.is_some_and(|paper| measure.is_misprint(&paper));
                let printed = number(paper.and_then(|paper| measure.printed(&paper)));
                row.push(if star { format!("*{printed}") } else { printed });
                let ratio = measure.ratio(channel);
                row.push(ratio.map_or_else(|| "-".to_owned(), |ratio| format!("{ratio:.2}")));
            }
            debug_assert_eq!(row.len(), columns);
            table.add_row(row);
        }
    }
    table.to_string()
}

/// An empty table that looks as the style wants it.
pub(super) fn styled(style: Style) -> Table {
    let mut table = Table::new();
    table.load_preset(match style {
        Style::Text => "     --            ",
        Style::Markdown => presets::ASCII_MARKDOWN,
    });
    table
}

/// Without the blanks that pad the last column.
pub(super) fn trim(table: &str) -> String {
    table
        .lines()
        .map(str::trim_end)
        .collect::<Vec<_>>()
        .join("\n")
}

fn summary(out: &mut String, report: &Report, style: Style, compared: bool) {
    let (data, summary) = (&report.data, &report.summary);
    let item = if style == Style::Markdown { "- " } else { "" };
    push(
        out,
        format_args!(
            "\n{item}Mean held-out RMSE over all materials and channels: {:.4}\n",
            summary.mean_held_out_rmse
        ),
    );
    if let (Some(ratio), Some(worst)) = (summary.rmse_ratio_to_paper, summary.worst_ratio_to_paper)
    {
        push(
            out,
            format_args!(
                "{item}Held-out RMSE / printed RMSE: {ratio:.2} (geometric mean), {worst:.2} (worst)\n"
            ),
        );
    }
    if compared && data.channels == ["average"] {
        push(
            out,
            format_args!(
                "{item}The paper column is the mean of the paper's red, green and blue figures, since \
             the data here are the average of the three channels. For RMSE and MAE this is a fair \
             bound: the error of an average of three predictions is at most the average of their \
             errors (triangle inequality). For correlation there is no such bound.\n"
            ),
        );
    }
    let misprint = report
        .materials
        .iter()
        .flat_map(|material| &material.channels)
        .any(|channel| channel.paper.is_some_and(|paper| paper.impossible_mae));
    if misprint {
        let star = if style == Style::Markdown { "\\*" } else { "*" };
        push(
            out,
            format_args!(
                "{item}{star} as printed, with 0.070 for cork's red channel, which exceeds its RMSE of \
             0.0173 and is a misprint (very likely for 0.0070); no ratio is given.\n"
            ),
        );
    }
    push(
        out,
        format_args!(
            "{item}'train' counts each measurement once per fold that trained on it, 'held out' once in \
         all; 'fold mean' is the mean of the held-out figures of the folds.\n"
        ),
    );
    let seconds = report.seconds;
    push(
        out,
        format_args!(
            "{item}Seconds: {:.3} load, {:.3} fit and evaluate, {:.3} total\n",
            seconds.load, seconds.fit, seconds.total
        ),
    );
}

pub(super) fn push(out: &mut String, text: std::fmt::Arguments<'_>) {
    // Writing to a String cannot fail.
    let _ = out.write_fmt(text);
}

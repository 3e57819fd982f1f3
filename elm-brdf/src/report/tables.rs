//! The report as Tables I to III, for a terminal or a document.

use std::fmt::Write;

use comfy_table::{CellAlignment, Table, presets};

use super::{Channel, Paper, Report, Summary};
use crate::metrics::Metrics;

/// Where a table is to be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Style {
    Text,
    Markdown,
}

/// A measure of error: the paper's three, each with a table of its own, and those that it lacks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Measure {
    Rmse,
    Mae,
    Correlation,
    RelativeRmse,
    LogCosine,
    CubeRoot,
}

impl Measure {
    pub(super) const PAPER: [Self; 3] = [Self::Rmse, Self::Mae, Self::Correlation];
    pub(super) const ALL: [Self; 6] = [
        Self::Rmse,
        Self::Mae,
        Self::Correlation,
        Self::RelativeRmse,
        Self::LogCosine,
        Self::CubeRoot,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Rmse => "rmse",
            Self::Mae => "mae",
            Self::Correlation => "correlation",
            Self::RelativeRmse => "relative_rmse",
            Self::LogCosine => "log_cosine_mae",
            Self::CubeRoot => "cube_root_rmse",
        }
    }

    fn title(self) -> &'static str {
        match self {
            Self::Rmse => "Table I: root mean squared error (BRDF in 1/sr)",
            Self::Mae => "Table II: mean absolute error (BRDF in 1/sr)",
            Self::Correlation => "Table III: correlation",
            Self::RelativeRmse => "RMSE over the root mean square of the measurements",
            Self::LogCosine => "mean |ln(1 + f cos theta_o) - ln(1 + g cos theta_o)|",
            Self::CubeRoot => "RMSE of the cube roots",
        }
    }

    pub(super) fn of(self, metrics: &Metrics) -> Option<f64> {
        match self {
            Self::Rmse => Some(metrics.rmse),
            Self::Mae => Some(metrics.mae),
            Self::Correlation => metrics.correlation,
            Self::RelativeRmse => metrics.relative_rmse,
            Self::LogCosine => Some(metrics.log_cosine_mae),
            Self::CubeRoot => Some(metrics.cube_root_rmse),
        }
    }

    pub(super) fn printed(self, paper: &Paper) -> Option<f64> {
        match self {
            Self::Rmse => Some(paper.rmse),
            Self::Mae => paper.mae,
            Self::Correlation => paper.correlation,
            Self::RelativeRmse | Self::LogCosine | Self::CubeRoot => None,
        }
    }

    fn is_misprint(self, paper: &Paper) -> bool {
        self == Self::Mae && paper.impossible_mae
    }

    /// Whether the held-out figure is better than the printed one; none where that is missing or
    /// impossible.
    pub(super) fn is_better(self, channel: &Channel) -> Option<bool> {
        let ratio = self.ratio(channel)?;
        Some(match self {
            Self::Correlation => ratio > 1.0,
            _ => ratio < 1.0,
        })
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
    for measure in Measure::PAPER {
        let mark = if style == Style::Markdown { "### " } else { "" };
        let suffix = if report.data.synthetic {
            ", SYNTHETIC data"
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
    let (mark, end) = match style {
        Style::Markdown => ("### ", "\n"),
        Style::Text => ("", ""),
    };
    push(
        &mut out,
        format_args!(
            "\n{mark}Beyond the paper: other measures of the held-out predictions, noise and \
             saturation\n{end}{}\n",
            trim(&further(report, style))
        ),
    );
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
                "{item}SYNTHETIC data, not measurements: no CUReT files were found, so there \
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
            "{item}Model: {}; {}-fold cross-validation, {}\n",
            protocol.describe(),
            protocol.folds,
            seeds(protocol.seed, protocol.seeds),
        ),
    );
}

/// The seeds in words.
pub(super) fn seeds(first: u64, count: usize) -> String {
    let last = first.saturating_add(count as u64).saturating_sub(1);
    match count {
        1 => format!("seed {first}"),
        _ => format!("mean over seeds {first} to {last}"),
    }
}

fn table(report: &Report, measure: Measure, compared: bool, style: Style) -> String {
    let mut table = styled(style);
    let mut header = vec!["material", "channel", "train", "held out", "fold mean"];
    if compared {
        header.extend(["paper", "held out / paper"]);
    }
    let several = report.protocol.seeds > 1;
    if several {
        header.insert(4, "+/-");
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
            if several {
                let deviation = channel.held_out_deviation.as_ref();
                row.insert(4, number(deviation.and_then(|d| measure.of(d))));
            }
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

/// The measures that the paper lacks, and what the measurements say of themselves.
fn further(report: &Report, style: Style) -> String {
    let mut table = styled(style);
    table.set_header([
        "material",
        "channel",
        "relative",
        "log-cosine",
        "cube root",
        "noise floor",
        "RMSE / floor",
        "suspect",
        "RMSE without",
    ]);
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let number = |value: Option<f64>, digits: usize| {
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
    };
    for material in &report.materials {
        for channel in &material.channels {
            let held_out = &channel.held_out;
            let floor = channel.noise_floor.map(|floor| floor.sigma);
            let over = floor.filter(|&floor| floor > 0.0);
            table.add_row([
                format!("{:>2} {}", material.id, material.name),
                channel.channel.clone(),
                number(held_out.relative_rmse, 3),
                number(Some(held_out.log_cosine_mae), 5),
                number(Some(held_out.cube_root_rmse), 4),
                number(floor, 4),
                number(over.map(|floor| held_out.rmse / floor), 2),
                channel.saturated.to_string(),
                number(Some(channel.held_out_unsaturated.rmse), 4),
            ]);
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
    if let Some(better) = summary.better_than_paper {
        let of = |(better, all): (usize, usize)| format!("{better} of {all}");
        push(
            out,
            format_args!(
                "{item}Held out better than printed: RMSE {}, MAE {}, correlation {}\n",
                of(better.rmse),
                of(better.mae),
                of(better.correlation)
            ),
        );
    }
    spread(out, summary, item);
    if let Some(floor) = data.noise_floor {
        push(
            out,
            format_args!(
                "{item}'noise floor' is the standard deviation of one measurement that pairs with \
                 light and viewer exchanged show; its median here is {floor:.4}. Part of that noise \
                 depends on the directions alone and can be learnt, so an error below it is \
                 possible.\n"
            ),
        );
    }
    push(
        out,
        format_args!(
            "{item}Suspect: {} of {} values ({:.2} %) look saturated (highlights whose radiance \
             piles up at the channel's largest); mean held-out RMSE without them: {:.4}\n",
            data.saturated,
            data.values,
            100.0 * data.saturated as f64 / data.values.max(1) as f64,
            summary.mean_held_out_rmse_unsaturated
        ),
    );
    legend(out, report, style, compared);
}

/// What the columns mean, and the times.
fn legend(out: &mut String, report: &Report, style: Style, compared: bool) {
    let item = if style == Style::Markdown { "- " } else { "" };
    let [relative, log_cosine, cube_root] =
        [Measure::RelativeRmse, Measure::LogCosine, Measure::CubeRoot].map(Measure::title);
    push(
        out,
        format_args!(
            "{item}'relative': {relative}; 'log-cosine': {log_cosine}; 'cube root': {cube_root}.\n"
        ),
    );
    if compared && report.data.channels == ["average"] {
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

/// Mean and range over the seeds.
fn spread(out: &mut String, summary: &Summary, item: &str) {
    let seeds = &summary.seeds;
    if seeds.len() < 2 {
        return;
    }
    let range = |values: Vec<f64>| {
        let (least, most) = (
            values.iter().copied().fold(f64::INFINITY, f64::min),
            values.iter().copied().fold(0.0, f64::max),
        );
        (least, most)
    };
    let (least, most) = range(seeds.iter().map(|seed| seed.mean_held_out_rmse).collect());
    push(
        out,
        format_args!(
            "{item}Over {} seeds the mean held-out RMSE runs from {least:.4} to {most:.4}",
            seeds.len()
        ),
    );
    let ratios: Vec<f64> = seeds.iter().filter_map(|s| s.rmse_ratio_to_paper).collect();
    if !ratios.is_empty() {
        let (least, most) = range(ratios);
        push(
            out,
            format_args!(", the ratio to the printed RMSE from {least:.2} to {most:.2}"),
        );
    }
    push(
        out,
        format_args!("; '+/-' is the standard deviation over seeds.\n"),
    );
}

pub(super) fn push(out: &mut String, text: std::fmt::Arguments<'_>) {
    // Writing to a String cannot fail.
    let _ = out.write_fmt(text);
}

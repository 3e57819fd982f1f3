//! A model as a plug-in for Mitsuba 3: one file of Python, with the network and its sampler inside.

use std::fmt::{Debug, Write};

use elm_datasets::Brdf;
use elm_datasets::mixture::{Lobe, LobeMixture};

use super::error::ExportError;
use super::network::{Network, Neuron, Values};
use super::spectrum::{self, PRIMARIES};
use super::{inputs, write::check_name};
use crate::error::Result;
use crate::model::BrdfModel;
use crate::target_transform::Channel;
use elm_datasets::rgl::Channels;

const TEMPLATE: &str = include_str!("mitsuba.py");

/// Mitsuba's own materials, which it prefers to a plug-in of the same name.
const TAKEN: [&str; 24] = [
    "blendbsdf",
    "bumpmap",
    "circular",
    "conductor",
    "dielectric",
    "diffuse",
    "hair",
    "mask",
    "measured",
    "measured_polarized",
    "normalmap",
    "null",
    "opacitymask",
    "plastic",
    "polarizer",
    "pplastic",
    "principled",
    "principledthin",
    "retarder",
    "roughconductor",
    "roughdielectric",
    "roughplastic",
    "thindielectric",
    "twosided",
];

/// The source of the plug-in, to be called by the file's `module` name and registered as `name`.
///
/// Weights are in double precision, and so is the evaluation unless a scene asks for single (on CUDA the
/// other way round).
///
/// In variants without wavelengths a spectrum is integrated to linear sRGB under D65; in spectral ones red,
/// green and blue are [spectra](super::PRIMARIES) that integrate to them.
///
/// # Errors
/// [`ExportError`] for a model with a piece that has no source, for a number beyond single precision, for a
/// name that is no name, for channels that are neither one, red, green and blue, nor a spectrum, and for a
/// model that single precision would spoil.
pub fn plugin(model: &BrdfModel, module: &str, name: &str) -> Result<String> {
    check_name(name)?;
    if TAKEN.contains(&name) {
        let name = name.to_owned();
        return Err(ExportError::Taken { name }.into());
    }
    let model = &model.in_rgb_order()?;
    let count = model.channels();
    let (channels, places) = match count {
        1 => (Channels::Rgb, vec![0]),
        _ => spectrum::channels(&model.provenance().channels, count)?,
    };
    let cost = super::check_precision(model)?;
    let mut network = Network::new(model)?;
    network.select(model.target_transform(), &places)?;
    let mixture = LobeMixture::of(model)?;
    let row = "its weights of the inputs or its centre, its bias, its weights in the outputs";
    let grained = |text: &str| match model.features().is_isotropic() {
        true => String::new(),
        false => text.to_owned(),
    };
    let is_rgb = matches!(channels, Channels::Rgb);
    let replaced = [
        ("@ABOUT@", about(model)),
        ("@MODULE@", module.to_owned()),
        ("@NAME@", name.to_owned()),
        (
            "@GRAIN@",
            grained("The grain\ncounts from the tangent dp/du. "),
        ),
        ("@ROW@", row.to_owned()),
        (
            "@SINGLE@",
            format!("{:.0e}", cost.rmse / cost.scale.max(f64::MIN_POSITIVE)),
        ),
        (
            "@CHANNELS@",
            match &channels {
                Channels::Rgb => "'rgb'".to_owned(),
                Channels::Spectrum(wavelengths) => list(wavelengths),
            },
        ),
        ("@COUNT@", network.inputs.len().to_string()),
        ("@GROUPS@", groups(&network.neurons)),
        ("@NEURONS@", neurons(&network)),
        (
            "@LINEAR@",
            rows(network.outputs.iter().map(|o| o.linear.clone())),
        ),
        (
            "@CONSTANT@",
            list(
                &network
                    .outputs
                    .iter()
                    .map(|o| o.constant)
                    .collect::<Vec<_>>(),
            ),
        ),
        ("@TARGETS@", targets(&network)),
        ("@LOBES@", lobes(&mixture)),
        (
            "@PRIMARIES@",
            if is_rgb {
                primaries()
            } else {
                "None".to_owned()
            },
        ),
        ("@ANISOTROPIC@", grained(" | mi.BSDFFlags.Anisotropic")),
    ];
    let (locals, expressions) = formulas(&network)?;
    let mut text = TEMPLATE
        .replace("@LOCALS@\n", &locals)
        .replace("@INPUTS@", &expressions);
    for (mark, value) in replaced {
        text = text.replace(mark, &value);
    }
    Ok(text)
}

/// Where the model comes from, in a line that cannot end a comment.
fn about(model: &BrdfModel) -> String {
    let provenance = model.provenance();
    let data = provenance.data.chars();
    let data: String = data
        .map(|c| match c {
            '"' | '\\' => '\'',
            c if c.is_control() => ' ',
            c => c,
        })
        .collect();
    let data = if data.is_empty() { "a material" } else { &data };
    let version = env!("CARGO_PKG_VERSION");
    format!("{data}, written by elm-brdf {version}.")
}

/// Lines of the function `inputs`, and what it returns.
fn formulas(network: &Network) -> Result<(String, String), ExportError> {
    let inputs: Vec<&str> = network
        .inputs
        .iter()
        .map(|name| inputs::expression(name))
        .collect::<Result<_, _>>()?;
    let python = |common: &str| {
        let names = [
            ("ANGLE(", "dr.atan2("),
            ("sqrt(", "dr.sqrt("),
            ("max(", "dr.maximum("),
        ];
        names
            .iter()
            .fold(common.to_owned(), |text, (from, to)| text.replace(from, to))
    };
    let mut locals = String::new();
    for (name, expression) in inputs::needed(inputs::LOCALS, &inputs) {
        // Writing to a string cannot fail.
        let _ = writeln!(locals, "    {name} = {}", python(expression));
    }
    let expressions: Vec<String> = inputs.iter().map(|e| python(e)).collect();
    Ok((locals, expressions.join(", ")))
}

fn list(numbers: &[impl Debug]) -> String {
    let numbers: Vec<String> = numbers.iter().map(|number| format!("{number:?}")).collect();
    format!("[{}]", numbers.join(", "))
}

fn rows(rows: impl Iterator<Item = Vec<f64>>) -> String {
    let rows: String = rows.map(|row| format!("    {},\n", list(&row))).collect();
    format!("[\n{rows}]")
}

fn groups(neurons: &[Neuron]) -> String {
    let mut first = 0;
    let mut groups = Vec::new();
    for group in neurons.chunk_by(Neuron::is_like) {
        let last = first + group.len();
        let scales = match group[0].center {
            Some(_) => list(&group[0].weights),
            None => "None".to_owned(),
        };
        groups.push(format!(
            "('{}', {first}, {last}, {scales})",
            group[0].activation
        ));
        first = last;
    }
    format!("[{}]", groups.join(", "))
}

fn neurons(network: &Network) -> String {
    let row = |neuron: &Neuron| {
        let weights = neuron.center.as_ref().unwrap_or(&neuron.weights).iter();
        let row = weights.chain([&neuron.bias]).chain(&neuron.beta);
        row.copied().collect::<Vec<f64>>()
    };
    if network.neurons.is_empty() {
        // Tensors have at least one row.
        let columns = network.inputs.len() + 1 + network.outputs.len();
        return rows(std::iter::once(vec![0.0; columns]));
    }
    rows(network.neurons.iter().map(row))
}

fn targets(network: &Network) -> String {
    let number = |value: f64| format!("{:?}", value.min(f64::from(f32::MAX)));
    // What has been selected has a value for each output.
    let Values::Direct(transforms) = &network.values else {
        return "[]".to_owned();
    };
    let targets: Vec<String> = transforms
        .iter()
        .map(|transform| match *transform {
            Channel::Identity => format!("('identity', 0.0, {})", number(f64::MAX)),
            Channel::Log { offset, ceiling } => {
                format!("('log', {}, {})", number(offset), number(ceiling.max(0.0)))
            }
            Channel::CubeRoot { ceiling } => {
                format!("('cube-root', 0.0, {})", number(ceiling.max(0.0)))
            }
        })
        .collect();
    format!("[{}]", targets.join(", "))
}

fn lobes(mixture: &LobeMixture) -> String {
    let mut text = String::from("[\n");
    for (lobe, weights) in mixture.lobes() {
        let (kind, parameters) = match *lobe {
            Lobe::Cosine => ("cosine", String::new()),
            Lobe::Tilted { factor } => ("tilted", format!("{factor:?},")),
            Lobe::Ggx { alpha, turn } => {
                let (sin, cos) = turn.sin_cos();
                (
                    "ggx",
                    format!("{:?}, {:?}, {sin:?}, {cos:?}", alpha[0], alpha[1]),
                )
            }
            Lobe::Round { width, retro } => {
                let retro = if retro { "True" } else { "False" };
                ("round", format!("{width:?}, {retro}"))
            }
            // `Uniform`; there are no others.
            _ => ("uniform", String::new()),
        };
        let _ = writeln!(text, "    ('{kind}', ({parameters}), {weights:?}),");
    }
    text + "]"
}

fn primaries() -> String {
    let (wavelengths, spectra) = PRIMARIES;
    let spectra: Vec<String> = spectra.iter().map(|s| list(s)).collect();
    format!("({}, [{}])", list(&wavelengths), spectra.join(", "))
}

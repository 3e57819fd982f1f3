//! A network written out in a language.

use std::fmt::Write;

use super::activations;
use super::dialect::Language;
use super::error::ExportError;
use super::inputs;
use super::network::{Network, Neuron};
use super::{preamble, precision, sampler};
use crate::error::{Error, Result};
use crate::model::BrdfModel;
use elm_datasets::Brdf;
use elm_datasets::mixture::LobeMixture;

/// Source of the functions `NAME_eval`, `NAME_pdf` and `NAME_sample`, with everything that they need.
///
/// | language | the function |
/// |---|---|
/// | GLSL | `vec3 NAME_eval(vec3 light, vec3 viewer)` |
/// | WGSL | `fn NAME_eval(light: vec3<f32>, viewer: vec3<f32>) -> vec3<f32>` |
/// | HLSL | `float3 NAME_eval(float3 light, float3 viewer)` |
/// | C | `void NAME_eval(const float light[3], const float viewer[3], float rgb[3])` |
///
/// `NAME_pdf` of the same directions is the density in solid angle with which `NAME_sample` finds the light
/// for a viewer, from two uniform numbers: `vec4 NAME_sample(vec3 viewer, vec2 u)`, the light and its
/// density; in C `float NAME_sample(const float viewer[3], const float u[2], float light[3])`, the density.
/// It is that of [`LobeMixture::of`].
///
/// Three channels that are called by colours or wavelengths are red, green and blue by that,
/// whatever their order. Of a spectrum it is the [colour](elm_datasets::color).
///
/// # Errors
/// [`ExportError`] for a model with a piece that has no source, for a number beyond single
/// precision, for a name that is no name, and for one that single precision would spoil
/// ([`check_precision`](super::check_precision)); [`Error::Channels`] for another number of channels
/// than 1 or 3.
pub fn source(model: &BrdfModel, language: Language, name: &str) -> Result<String> {
    let mut out = evaluator(model, language, name, true)?;
    let mixture = LobeMixture::of(&model.in_color()?)?;
    sampler::write(language, name, &mixture, &mut out);
    Ok(out)
}

/// As [`source`], of `NAME_eval` alone, or with a preamble that speaks of the others, too.
pub(super) fn evaluator(
    model: &BrdfModel,
    language: Language,
    name: &str,
    is_sampled: bool,
) -> Result<String> {
    check_name(name)?;
    let model = &model.in_color()?;
    let channels = model.channels();
    if channels != 1 && channels != 3 {
        return Err(Error::Channels { channels });
    }
    let network = Network::new(model)?;
    precision::check_precision(model)?;
    let mut writer = Writer {
        language,
        name,
        network: &network,
        out: String::new(),
    };
    writer.whole(is_sampled)?;
    Ok(writer.out)
}

/// C source as a header: guarded against being included twice, and with functions of its own for
/// each file that includes it.
#[must_use]
pub fn header(source: &str, name: &str) -> String {
    let guard = format!("{}_EVAL_H", name.to_uppercase());
    let public = ["void NAME_eval(", "float NAME_pdf(", "float NAME_sample("];
    let public = public.map(|head| head.replace("NAME", name));
    // The functions' declarations and their definitions begin lines; nothing else does.
    let body: Vec<String> = source
        .lines()
        .map(|line| {
            if public.iter().any(|head| line.starts_with(head)) {
                format!("static inline {line}")
            } else {
                line.to_owned()
            }
        })
        .collect();
    format!(
        "#ifndef {guard}\n#define {guard}\n\n{}\n\n#endif\n",
        body.join("\n")
    )
}

/// A letter, then letters, digits and single underscores, as all the languages have it.
pub(super) fn check_name(name: &str) -> Result<(), ExportError> {
    let good = name.starts_with(|c: char| c.is_ascii_alphabetic())
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        && !name.contains("__")
        && !name.ends_with('_')
        && !name.starts_with("gl_");
    if good {
        Ok(())
    } else {
        Err(ExportError::Name {
            name: name.to_owned(),
        })
    }
}

/// The components of both directions, in the shaders' notation.
const COMPONENTS: [(&str, &str); 6] = [
    ("ix", "light.x"),
    ("iy", "light.y"),
    ("iz", "light.z"),
    ("ox", "viewer.x"),
    ("oy", "viewer.y"),
    ("oz", "viewer.z"),
];

pub(super) struct Writer<'a> {
    pub(super) language: Language,
    /// What the names of all functions begin with.
    pub(super) name: &'a str,
    pub(super) network: &'a Network,
    pub(super) out: String,
}

impl<'a> Writer<'a> {
    fn whole(&mut self, is_sampled: bool) -> Result<(), ExportError> {
        let network = self.network;
        let inputs: Vec<&str> = self
            .network
            .inputs
            .iter()
            .map(|name| inputs::expression(name))
            .collect::<Result<_, _>>()?;
        let locals = inputs::needed(inputs::LOCALS, &inputs);
        let used: Vec<&str> = locals
            .iter()
            .map(|(_, e)| *e)
            .chain(inputs.clone())
            .collect();
        let components = inputs::needed(&COMPONENTS, &used);

        preamble::write(self.language, self.name, network, is_sampled, &mut self.out);
        if used.iter().any(|e| e.contains("ANGLE")) {
            self.angle();
        }
        for group in self
            .network
            .neurons
            .chunk_by(|a, b| a.activation == b.activation)
        {
            self.activation(&group[0].activation)?;
        }
        if self.language == Language::C {
            self.tables();
        }
        self.open();
        for (name, expression) in components {
            match self.language {
                Language::C => {
                    let index = ["x", "y", "z"].iter().position(|c| expression.ends_with(c));
                    let array = expression.split('.').next().unwrap_or(expression);
                    self.line(&format!(
                        "const float {name} = {array}[{}];",
                        index.unwrap_or(0)
                    ));
                }
                _ => self.number(name, expression),
            }
        }
        for (name, expression) in locals {
            self.number(name, expression);
        }
        if self.language == Language::C {
            self.loops(&inputs);
        } else {
            self.unrolled(&inputs);
        }
        self.close();
        Ok(())
    }

    /// Neurons that can be computed side by side.
    fn groups(&self) -> Vec<&'a [Neuron]> {
        let network: &'a Network = self.network;
        network.neurons.chunk_by(Neuron::is_like).collect()
    }

    /// Adds a line to a function's body.
    pub(super) fn line(&mut self, text: &str) {
        // Writing to a string cannot fail, here and below.
        let _ = writeln!(self.out, "    {text}");
    }

    /// Common notation, with this file's own arc tangent.
    fn own(&self, common: &str) -> String {
        common.replace("ANGLE", &format!("{}_angle", self.name))
    }

    /// Defines a number.
    fn number(&mut self, name: &str, expression: &str) {
        let kind = self.language.number();
        let text = self.language.define(kind, name, &self.own(expression));
        self.line(&text);
    }

    /// A function of numbers, or of fours, made of definitions and a result.
    fn function(
        &mut self,
        name: &str,
        kind: &str,
        arguments: &[&str],
        lines: &[(&str, &str)],
        result: &str,
    ) {
        let arguments: Vec<(&str, &str)> = arguments.iter().map(|&a| (kind, a)).collect();
        let name = format!("{}_{name}", self.name);
        let head = self.language.head(kind, &name, &arguments);
        let _ = writeln!(self.out, "{head}");
        for (name, expression) in lines {
            let text = self.language.define(kind, name, expression);
            self.line(&text);
        }
        let text = format!("return {};", self.language.expression(result));
        self.line(&text);
        self.out.push_str("}\n\n");
    }

    fn angle(&mut self) {
        let kind = self.language.number();
        self.function(
            "angle",
            kind,
            &["y", "x"],
            inputs::ANGLE,
            inputs::ANGLE_RESULT,
        );
    }

    fn activation(&mut self, name: &str) -> Result<(), ExportError> {
        let function = activations::function(name)?;
        let kind = self.language.four();
        self.function(
            &identifier(name),
            kind,
            &["z"],
            function.lines,
            function.result,
        );
        Ok(())
    }

    /// The head of the function itself, and what is below the horizon.
    fn open(&mut self) {
        let (language, name) = (self.language, format!("{}_eval", self.name));
        match language {
            Language::C => {
                let head = format!(
                    "void {name}(const float light[3], const float viewer[3], float rgb[3])"
                );
                let _ = writeln!(self.out, "{head};\n\n{head} {{");
                self.line("rgb[0] = rgb[1] = rgb[2] = 0.0f;");
                self.line("if (!(light[2] > 0.0f && viewer[2] > 0.0f)) { return; }");
            }
            _ => {
                let three = language.three();
                let arguments = [(three, "light"), (three, "viewer")];
                let _ = writeln!(self.out, "{}", language.head(three, &name, &arguments));
                self.line(&format!(
                    "if (!(light.z > 0.0 && viewer.z > 0.0)) {{ return {three}(0.0, 0.0, 0.0); }}"
                ));
            }
        }
    }

    /// The sums of the outputs, four neurons at a time: constants in the code, which shader
    /// compilers keep where tables of this size would have to be fetched from memory.
    fn unrolled(&mut self, inputs: &[&str]) {
        let language = self.language;
        for (index, expression) in inputs.iter().enumerate() {
            self.number(&format!("x{index}"), expression);
        }
        let network = self.network;
        for (index, output) in network.outputs.iter().enumerate() {
            let start = std::iter::once(language.literal(output.constant));
            let linear = output.linear.iter().enumerate();
            let linear = linear
                .filter(|(_, weight)| **weight != 0.0)
                .map(|(input, weight)| format!("{} * x{input}", language.literal(*weight)));
            let sum = start.chain(linear).collect::<Vec<_>>().join(" + ");
            self.line(&match language {
                Language::Wgsl => format!("var t{index} = f32({sum});"),
                _ => format!("float t{index} = {sum};"),
            });
        }
        // Missing neurons of the last four have no weight.
        let four = |value: &dyn Fn(&Neuron) -> f64, neurons: &[Neuron]| {
            let parts = (0..4).map(|n| language.literal(neurons.get(n).map_or(0.0, value)));
            format!(
                "{}({})",
                language.four(),
                parts.collect::<Vec<_>>().join(", ")
            )
        };
        let mut count = 0;
        for group in self.groups() {
            let function = format!("{}_{}", self.name, identifier(&group[0].activation));
            for neurons in group.chunks(4) {
                let sum = if group[0].center.is_some() {
                    let of = |n: &Neuron, i: usize| n.center.as_ref().map_or(0.0, |c| c[i]);
                    for i in 0..inputs.len() {
                        let weights = four(&|n| n.weights[i], neurons);
                        let centers = four(&|n| of(n, i), neurons);
                        let apart = format!("{weights} * x{i} - {centers}");
                        let name = format!("p{count}_{i}");
                        self.line(&language.define(language.four(), &name, &apart));
                    }
                    let squares = (0..inputs.len()).map(|i| format!("p{count}_{i} * p{count}_{i}"));
                    format!("sqrt({})", squares.collect::<Vec<_>>().join(" + "))
                } else {
                    let terms = (0..inputs.len())
                        .map(|i| format!("{} * x{i}", four(&|n| n.weights[i], neurons)))
                        .chain([four(&|n| n.bias, neurons)]);
                    terms.collect::<Vec<_>>().join(" + ")
                };
                let h = format!("h{count}");
                self.line(&language.define(language.four(), &h, &format!("{function}({sum})")));
                for output in 0..network.outputs.len() {
                    let beta = four(&|n| n.beta[output], neurons);
                    self.line(&format!("t{output} = t{output} + dot({beta}, {h});"));
                }
                count += 1;
            }
        }
    }

    /// The weights as tables, for C.
    fn tables(&mut self) {
        let rows = |values: &[Vec<f64>]| -> String {
            let row = |row: &Vec<f64>| {
                let numbers: Vec<String> = row.iter().map(|&v| Language::C.literal(v)).collect();
                format!("    {{{}}},\n", numbers.join(", "))
            };
            values.iter().map(row).collect()
        };
        let Network {
            inputs,
            neurons,
            outputs,
            ..
        } = self.network;
        self.spectrum_table();
        if neurons.is_empty() {
            return;
        }
        // One row per neuron: its weights or its center, its bias, its output weights.
        let table: Vec<Vec<f64>> = neurons
            .iter()
            .map(|n| {
                let bias = std::iter::once(&n.bias);
                n.center
                    .as_ref()
                    .unwrap_or(&n.weights)
                    .iter()
                    .chain(bias)
                    .chain(&n.beta)
                    .copied()
                    .collect()
            })
            .collect();
        let _ = write!(
            self.out,
            "/* By neuron: weights of the inputs or center, bias, output weights. */\n\
             static const float {}_neurons[{}][{}] = {{\n{}}};\n\n",
            self.name,
            neurons.len(),
            inputs.len() + 1 + outputs.len(),
            rows(&table)
        );
    }

    /// The sums of the outputs, neuron by neuron.
    fn loops(&mut self, inputs: &[&str]) {
        let language = Language::C;
        let network = self.network;
        let list = |values: Vec<String>| values.join(", ");
        let x: Vec<String> = inputs
            .iter()
            .map(|e| language.expression(&self.own(e)))
            .collect();
        self.line(&format!("const float x[{}] = {{{}}};", x.len(), list(x)));
        let starts = network.outputs.iter().map(|output| {
            let start = std::iter::once(language.literal(output.constant));
            let linear = output.linear.iter().enumerate();
            let linear = linear
                .filter(|(_, weight)| **weight != 0.0)
                .map(|(input, weight)| format!("{} * x[{input}]", language.literal(*weight)));
            start.chain(linear).collect::<Vec<_>>().join(" + ")
        });
        let starts = list(starts.collect());
        let (inputs, outputs) = (inputs.len(), network.outputs.len());
        self.line(&format!("float t[{outputs}] = {{{starts}}};"));
        let mut first = 0;
        for group in self.groups() {
            let last = first + group.len();
            let (name, function) = (self.name, identifier(&group[0].activation));
            // How far z is, and how to come to it.
            let (start, step, z) = if group[0].center.is_some() {
                let weights = group[0].weights.iter().map(|&w| language.literal(w));
                let weights = list(weights.collect());
                self.line(&format!("const float s{first}[{inputs}] = {{{weights}}};"));
                let step = format!("const float p = s{first}[i] * x[i] - n[i]; z += p * p;");
                ("0.0f".to_owned(), step, "sqrtf(z)")
            } else {
                (format!("n[{inputs}]"), "z += n[i] * x[i];".to_owned(), "z")
            };
            for text in [
                &format!("for (int k = {first}; k < {last}; ++k) {{"),
                &format!("    const float *n = {name}_neurons[k];"),
                &format!("    float z = {start};"),
                &format!("    for (int i = 0; i < {inputs}; ++i) {{ {step} }}"),
                &format!("    const float h = {name}_{function}({z});"),
                &format!(
                    "    for (int c = 0; c < {outputs}; ++c) {{ t[c] += n[{} + c] * h; }}",
                    inputs + 1
                ),
                "}",
            ] {
                self.line(text);
            }
            first = last;
        }
    }
}

/// An activation's name as part of a function's.
fn identifier(activation: &str) -> String {
    activation.replace('-', "_")
}

//! The comment that an exported source begins with: what its functions are, and how to call them.

use std::fmt::Write;

use super::dialect::Language;
use super::network::{Network, Values};

/// What a caller must know of a material with a grain.
const TANGENT_NOTICE: &str = "\
// The material has a grain: +x is the surface's tangent, +y its bitangent, as azimuths were measured.
";

/// What is to be known of the functions that sample.
const SAMPLED: &str = "\
// NAME_sample: a direction towards the light for a viewer, drawn about in proportion to
// NAME_eval times the cosine light.z, from two independent uniform numbers u in [0, 1).
// NAME_pdf: the density of that direction per steradian; its integral over the hemisphere is 1.
// A density of 0 means that there is none: the viewer is below the horizon.
//
";

const GLSL: &str = "\
// An estimate of the light that leaves towards the viewer, in the frame of the surface:
//     vec3 viewer = vec3(dot(-ray, tangent), dot(-ray, bitangent), dot(-ray, normal));
//     vec4 drawn = NAME_sample(viewer, vec2(random(), random()));
//     if (drawn.w > 0.0) {
//         vec3 light = drawn.xyz;
//         vec3 weight = NAME_eval(light, viewer) * light.z / drawn.w;
//         vec3 towards = light.x * tangent + light.y * bitangent + light.z * normal;
//         radiance += weight * incoming(position, towards);
//     }
//     // With a light's own sample: balance by NAME_pdf(light, viewer).
//
";

const WGSL: &str = "\
// An estimate of the light that leaves towards the viewer, in the frame of the surface:
//     let viewer = vec3<f32>(dot(-ray, tangent), dot(-ray, bitangent), dot(-ray, normal));
//     let drawn = NAME_sample(viewer, vec2<f32>(random(), random()));
//     if (drawn.w > 0.0) {
//         let light = drawn.xyz;
//         let weight = NAME_eval(light, viewer) * light.z / drawn.w;
//         let towards = light.x * tangent + light.y * bitangent + light.z * normal;
//         radiance += weight * incoming(position, towards);
//     }
//     // With a light's own sample: balance by NAME_pdf(light, viewer).
//
";

const C: &str = "\
// An estimate of the light that leaves towards the viewer, in the frame of the surface:
//     const float u[2] = {uniform(), uniform()};
//     float light[3], rgb[3];
//     const float pdf = NAME_sample(viewer, u, light);
//     if (pdf > 0.0f) {
//         NAME_eval(light, viewer, rgb);
//         for (int c = 0; c < 3; ++c) {
//             radiance[c] += rgb[c] * light[2] / pdf * incoming(light, c);
//         }
//     }
//
";

/// The comment, and what the language wants before everything else. Without `is_sampled` the file has no
/// functions that sample.
pub(super) fn write(
    language: Language,
    name: &str,
    network: &Network,
    is_sampled: bool,
    out: &mut String,
) {
    let Network {
        inputs,
        neurons,
        values,
        ..
    } = network;
    let mut kinds: Vec<&str> = neurons.iter().map(|n| n.activation.as_str()).collect();
    kinds.dedup();
    let example = match language {
        Language::Glsl => GLSL.to_owned(),
        Language::Wgsl => WGSL.to_owned(),
        Language::Hlsl => GLSL.replace("vec", "float"),
        Language::C => C.to_owned(),
    };
    let sampled = if is_sampled {
        format!("{SAMPLED}{example}").replace("NAME", name)
    } else {
        String::new()
    };
    let has_grain = inputs.iter().any(|input| input.contains("phi_h"));
    // Writing to a string cannot fail.
    let _ = write!(
        out,
        "// {name}_eval: the BRDF of a material in 1/sr, as linear red, green and blue.\n\
         // light, viewer: unit vectors from the surface, in its own frame with the normal\n\
         // along +z. Black below the horizon.\n\
         {grain}//\n\
         {sampled}\
         // An extreme learning machine, written by elm-brdf {version}.\n\
         // Neurons: {count}, {kinds}\n\
         // Inputs: {inputs}\n\
         // Channels: {channels}{spectrum}\n\n",
        version = env!("CARGO_PKG_VERSION"),
        count = neurons.len(),
        kinds = kinds.join(", "),
        channels = values.count(),
        spectrum = match values {
            Values::Direct(_) => String::new(),
            Values::Color(spectrum) => format!(
                ", linear sRGB of {} wavelengths under D65 (CIE 1931, 2 degrees)",
                spectrum.len()
            ),
        },
        inputs = inputs.join("; "),
        grain = if has_grain { TANGENT_NOTICE } else { "" },
    );
    match language {
        Language::Glsl => out.push_str("precision highp float;\n\n"),
        Language::C => out.push_str("#include <math.h>\n\n"),
        Language::Wgsl | Language::Hlsl => {}
    }
}

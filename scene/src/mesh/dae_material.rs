//! COLLADA materials: from the material symbol of a primitive to a color or an image.

use std::collections::HashMap;

use roxmltree::Node;

use super::dae::{Dae, child, children, line};
use super::error::percent_decoded;
use super::{MeshError, MeshMaterial, TextureSource};

/// Binding of a material symbol by `<instance_material>`.
pub(super) struct Binding<'a, 'i> {
    element: Node<'a, 'i>,
    /// Texture coordinate sets, by the name that `<texture texcoord>` uses.
    sets: HashMap<&'a str, u32>,
}

impl<'a, 'i> Binding<'a, 'i> {
    /// Bindings of an `<instance_geometry>` or `<instance_controller>`, by symbol.
    pub(super) fn of_instance(instance: Node<'a, 'i>) -> HashMap<&'a str, Self> {
        let materials = children(instance, "bind_material")
            .flat_map(|b| children(b, "technique_common"))
            .flat_map(|t| children(t, "instance_material"));
        let binding = |element: Node<'a, 'i>| {
            let inputs = children(element, "bind_vertex_input");
            let sets = inputs.filter_map(|i| {
                let set = i.attribute("input_set").unwrap_or("0").trim().parse().ok()?;
                Some((i.attribute("semantic")?, set))
            });
            Some((element.attribute("symbol")?, Self { element, sets: sets.collect() }))
        };
        materials.filter_map(binding).collect()
    }
}

impl<'a, 'i> Dae<'a, 'i> {
    /// Material of a primitive, `None` if the file does not define one or gives it no base color, and the texture
    /// coordinate set of its diffuse texture, if the file names one.
    pub(super) fn material_of(
        &mut self,
        primitive: Node<'a, 'i>,
        bindings: &HashMap<&'a str, Binding<'a, 'i>>,
    ) -> Result<(Option<usize>, Option<u32>), MeshError> {
        let Some(symbol) = primitive.attribute("material") else { return Ok((None, None)) };
        let (material, binding) = match bindings.get(symbol) {
            Some(binding) => (self.target(binding.element, "target")?, Some(binding)),
            // Some exporters omit the binding and use the id of the material as its symbol.
            None => match self.by_id(symbol).filter(|n| n.tag_name().name() == "material") {
                Some(material) => (material, None),
                None => return Ok((None, None)),
            },
        };
        let Some(effect) = child(material, "instance_effect") else { return Ok((None, None)) };
        let effect = self.target(effect, "url")?;
        let diffuse = diffuse(effect);
        let texcoord = diffuse.and_then(|d| child(d, "texture")).and_then(|t| t.attribute("texcoord"));
        let uv_set = texcoord.and_then(|name| binding?.sets.get(name).copied());
        let id = material.attribute("id").unwrap_or_default();
        if let Some(known) = self.materials.get(id) {
            return Ok((*known, uv_set));
        }
        let name = material.attribute("name").unwrap_or(id).to_owned();
        let handle = match diffuse {
            None => None,
            Some(diffuse) => {
                let mut look = MeshMaterial { name, rgba: [1.0; 4], texture: None };
                if let Some(texture) = child(diffuse, "texture") {
                    look.texture = self.image(effect, texture).map(TextureSource::File);
                } else if let Some(color) = self.color(effect, diffuse) {
                    let rgba: [f64; 4] = match self.exactly::<3>(color) {
                        Ok([r, g, b]) => [r, g, b, 1.0],
                        Err(_) => self.exactly(color)?,
                    };
                    if !rgba.iter().all(|x| x.is_finite()) {
                        return Err(self.ctx.invalid(line(color), "color is not finite; expected 0..=1"));
                    }
                    look.rgba = rgba.map(|x| x.clamp(0.0, 1.0) as f32);
                }
                Some(self.builder.material(look))
            }
        };
        self.materials.insert(id, handle);
        Ok((handle, uv_set))
    }

    /// Finds the color of a `<diffuse>`: its `<color>`, or the `<float4>` or `<float3>` of the effect parameter that
    /// its `<param ref>` names; `None` without either.
    fn color(&self, effect: Node<'a, 'i>, diffuse: Node<'a, 'i>) -> Option<Node<'a, 'i>> {
        child(diffuse, "color").or_else(|| {
            let name = child(diffuse, "param")?.attribute("ref")?;
            let param = parameter(effect, name)?;
            child(param, "float4").or_else(|| child(param, "float3"))
        })
    }

    /// Image file of a texture. The texture names a sampler, which names a surface, which names an image; or the
    /// texture names the image directly. `None` if a name is missing or unknown.
    fn image(&self, effect: Node<'a, 'i>, texture: Node<'a, 'i>) -> Option<std::path::PathBuf> {
        let name = texture.attribute("texture")?;
        let mut image = name;
        if let Some(sampler) = parameter(effect, name).and_then(|p| child(p, "sampler2D")) {
            if let Some(instance) = child(sampler, "instance_image") {
                image = instance.attribute("url")?.trim().trim_start_matches('#');
            } else {
                image = child(sampler, "source")?.text()?.trim();
                if let Some(surface) = parameter(effect, image).and_then(|p| child(p, "surface")) {
                    image = child(surface, "init_from")?.text()?.trim();
                }
            }
        }
        let image = self.by_id(image).filter(|n| n.tag_name().name() == "image")?;
        let from = child(image, "init_from")?;
        let written = child(from, "ref").unwrap_or(from).text()?;
        Some(self.ctx.beside(&percent_decoded(written.trim())))
    }
}

fn parameter<'a, 'i>(effect: Node<'a, 'i>, sid: &str) -> Option<Node<'a, 'i>> {
    effect.descendants().find(|n| n.tag_name().name() == "newparam" && n.attribute("sid") == Some(sid))
}

/// Element with the base color: `<diffuse>` of the shading model, or its `<emission>` without a `<diffuse>`; `None`
/// without both.
fn diffuse<'a, 'i>(effect: Node<'a, 'i>) -> Option<Node<'a, 'i>> {
    let profile = child(effect, "profile_COMMON")?;
    let technique = child(profile, "technique")?;
    let shader =
        technique.children().find(|n| matches!(n.tag_name().name(), "phong" | "lambert" | "blinn" | "constant"))?;
    child(shader, "diffuse").or_else(|| child(shader, "emission"))
}

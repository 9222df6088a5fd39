//! Targets of ray sensors.

use crate::error::SensorError;
use crate::select::{Selection, at_least_one, matching};
use crate::sensor::SensorContext;
use kinetoscope_scene::RenderScene;
use serde::{Deserialize, Serialize};

/// Targets of rays: visual geometry as seen by cameras (the visuals of robots, not their collision shapes), of some
/// geom groups. Tendons, skins and flexes, whose shapes change, are never targets. Instances that an environment hides
/// are not hit there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum HitTargets {
    /// Instances fixed to the world: the ground, terrain, static objects, and the parts of robots that cannot move.
    StaticOnly,
    /// Instances matched by name patterns: links `uid/link` (or `link` alone), objects by their uid, geoms of the world
    /// by their name (`ground`). Patterns are regular expressions that must match the whole name. Hidden instances are
    /// hit in environments that show them. When the sensor is added, each pattern must match an instance that some
    /// environment shows.
    Named(Vec<String>),
    /// All instances.
    Everything {
        /// Excludes the parent body of the sensor, with everything fused to it; without effect for a sensor without a
        /// parent.
        exclude_parent: bool,
    },
}

impl Default for HitTargets {
    fn default() -> Self {
        Self::Everything { exclude_parent: true }
    }
}

impl HitTargets {
    /// Returns the indices of the target instances, in ascending order.
    ///
    /// # Errors
    ///
    /// A pattern that is not a regular expression or matches no possible target, or an empty list of patterns.
    pub(crate) fn select(
        &self,
        scene: &RenderScene,
        groups: u32,
        parent: Option<usize>,
        context: &SensorContext,
    ) -> Result<Vec<usize>, SensorError> {
        // Ray casters support rigid shapes only.
        let in_groups = |instance: &kinetoscope_scene::Instance| {
            !instance.is_deformable && 1u32.checked_shl(instance.group.into()).is_some_and(|bit| groups & bit != 0)
        };
        let named = match self {
            Self::Named(patterns) => Some(matched_instances(scene, patterns, context, in_groups)?),
            _ => None,
        };
        let moving_body = |body: usize| context.moving_bodies.get(body).copied().unwrap_or(body);
        let is_target = |(index, instance): &(usize, &kinetoscope_scene::Instance)| {
            // Hidden instances count too: they may be visible in an environment with its own scene.
            in_groups(instance)
                && match self {
                    Self::StaticOnly => instance.fixed,
                    Self::Named(_) => named.as_ref().is_some_and(|named| named[*index]),
                    Self::Everything { exclude_parent } => {
                        let body = instance.body.map(|body| moving_body(body as usize));
                        !exclude_parent || parent.is_none() || body != parent.map(moving_body)
                    }
                }
        };
        Ok(scene.instances().iter().enumerate().filter(is_target).map(|(index, _)| index).collect())
    }
}

/// Returns true for each instance that the patterns match. Instances outside the geom groups cannot be matched.
///
/// A new sensor is rejected if a pattern matches only instances that no environment shows: it would miss everything. A
/// rebuilt sensor is accepted, because visibility may have changed since, and may change again.
fn matched_instances(
    scene: &RenderScene,
    patterns: &[String],
    context: &SensorContext,
    in_groups: impl Fn(&kinetoscope_scene::Instance) -> bool,
) -> Result<Vec<bool>, SensorError> {
    let names_of = |may_be_hit: &dyn Fn(usize) -> bool| {
        let instances = scene.instances().iter().enumerate().filter(|(index, i)| in_groups(i) && may_be_hit(*index));
        let mut names: Vec<String> = instances.map(|(_, i)| i.name.to_string()).filter(|n| !n.is_empty()).collect();
        names.sort();
        names.dedup();
        names
    };
    if !context.rebuilt {
        let shown = names_of(&|index| {
            let own = context.own_scenes.iter().filter_map(|own| own.0.as_deref());
            std::iter::once(scene).chain(own).any(|scene| scene.instances().get(index).is_some_and(|i| i.visible))
        });
        at_least_one(patterns.len(), Selection { sensor: "ray", field: "targets", what: "ray target" }, &shown)?;
        for pattern in patterns {
            matching(pattern, &shown, "ray target")?;
        }
    }
    let names = names_of(&|_| true);
    at_least_one(patterns.len(), Selection { sensor: "ray", field: "targets", what: "ray target" }, &names)?;
    let mut named = vec![false; names.len()];
    for pattern in patterns {
        matching(pattern, &names, "ray target")?.into_iter().for_each(|index| named[index] = true);
    }
    let is_named = |name: &str| names.binary_search_by(|n| n.as_str().cmp(name)).is_ok_and(|index| named[index]);
    Ok(scene.instances().iter().map(|i| is_named(&i.name)).collect())
}

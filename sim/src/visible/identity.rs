//! Mask ids: the numbers in the mask channel of cameras, and the elements that they identify.

use super::{color, deforming, visibility};
use crate::entity_set::EntitySet;
use kinetoscope_mujoco::{Model, ObjectKind};
use kinetoscope_sensors::camera::SegmentedEntity;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Element that a number in the mask channel identifies, the same in every environment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MaskId {
    /// Value in the mask channel. Never 0, which is the background.
    pub id: i32,
    /// Uid of the robot, articulation, object, terrain or MJCF part, or `ground`. In a model without a simulation: the
    /// first body of the kinematic tree, the geom or site of the world, the tendon, the skin or the flex.
    pub object: String,
    /// Link, body of an MJCF part, or tendon; `None` for the ground, terrains, objects and geoms of the world. In a
    /// model without a simulation, the body.
    pub link: Option<String>,
    /// Semantic class: the configured one, else `ground`, `terrain`, `robot`, `articulation`, `object` or `mjcf`. In a
    /// model without a simulation: `world`, `body`, `tendon`, `skin` or `flex`.
    pub class: String,
    /// Name of the body in MuJoCo, such as `body 3` for a body without a name; the world body for tendons, skins and
    /// flexes.
    pub body: String,
    /// Names of the geoms in MuJoCo, such as `geom 12` for a geom without a name. Empty for tendons, skins, flexes, and
    /// bodies that have sites only.
    pub geoms: Vec<String>,
}

impl MaskId {
    /// Full name: `object`, or `object/link`; for a tendon of a simulation, `object/tendon`.
    pub fn name(&self) -> String {
        self.link.as_ref().map_or_else(|| self.object.clone(), |link| format!("{}/{link}", self.object))
    }
}

impl From<&MaskId> for SegmentedEntity {
    fn from(id: &MaskId) -> Self {
        Self { id: id.id, object: id.object.clone(), link: id.link.clone(), class: id.class.clone() }
    }
}

/// Mask ids of the elements of a model.
#[derive(Clone, Debug)]
pub(crate) struct MaskIdMap {
    table: Arc<[MaskId]>,
    of_geom: Vec<ElementIdentity>,
    /// Rendered sites.
    of_site: Vec<(usize, ElementIdentity)>,
    /// Rendered elements whose shape changes.
    of_drawable: Vec<(DeformingElement, ElementIdentity)>,
}

/// Rendered element whose shape changes, by its index in MuJoCo's arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DeformingElement {
    Tendon(usize),
    Skin(usize),
    Flex(usize),
}

impl DeformingElement {
    /// Class of the element in a table of mask ids.
    pub(crate) fn class(self) -> &'static str {
        match self {
            Self::Tendon(_) => "tendon",
            Self::Skin(_) => "skin",
            Self::Flex(_) => "flex",
        }
    }

    /// Name of the element; its class and index if it has no name.
    pub(crate) fn name(self, model: &Model) -> String {
        let (kind, number) = match self {
            Self::Tendon(tendon) => (ObjectKind::Tendon, tendon),
            Self::Skin(skin) => (ObjectKind::Skin, skin),
            Self::Flex(flex) => (ObjectKind::Flex, flex),
        };
        model.name(kind, number).unwrap_or_else(|| format!("{} {number}", self.class()))
    }
}

/// Mask id, name and sensor body of a rendered element.
#[derive(Clone, Debug)]
pub(super) struct ElementIdentity {
    pub(super) mask_id: i32,
    /// Name: `uid/link`, `uid/tendon` or the uid in a simulation. In a model without a simulation: that of the body, of
    /// the geom or site of the world, or of the tendon, skin or flex.
    pub(super) name: Arc<str>,
    /// Index on the body axis of sensors; `None` for the world, and for a model without a simulation.
    pub(super) body: Option<u32>,
}

impl MaskIdMap {
    /// Mask id, name and sensor body of a geom.
    pub(super) fn of(&self, geom: usize) -> &ElementIdentity {
        &self.of_geom[geom]
    }

    /// Rendered sites.
    pub(super) fn sites(&self) -> impl Iterator<Item = (usize, &ElementIdentity)> {
        self.of_site.iter().map(|(site, identity)| (*site, identity))
    }

    /// Rendered elements whose shape changes.
    pub(super) fn drawables(&self) -> impl Iterator<Item = (DeformingElement, &ElementIdentity)> {
        self.of_drawable.iter().map(|(drawable, identity)| (*drawable, identity))
    }

    /// Mask ids and their elements, in ascending order.
    pub(crate) fn table(&self) -> &[MaskId] {
        &self.table
    }

    pub(super) fn shared_table(&self) -> Arc<[MaskId]> {
        Arc::clone(&self.table)
    }
}

/// Name of a geom, generated if it has no name.
fn geom_name(model: &Model, geom: usize) -> String {
    model.name(ObjectKind::Geom, geom).unwrap_or_else(|| format!("geom {geom}"))
}

/// Name of a body, generated if it has no name.
fn body_name(model: &Model, body: usize) -> String {
    model.name(ObjectKind::Body, body).unwrap_or_else(|| format!("body {body}"))
}

/// Assigns a mask id to each body with geoms, and to each visible tendon, skin and flex and each geom of the world.
/// With `sites`, bodies with visible sites but no geoms, and visible sites of the world, have mask ids as well.
pub(super) fn by_body(model: &Model, sites: bool) -> MaskIdMap {
    let mut table: Vec<MaskId> = Vec::new();
    let mut of_body = vec![0; model.nbody()];
    let of_geom = (0..model.ngeom())
        .map(|geom| {
            let body = model.geom_bodyid()[geom] as usize;
            let name = if body > 0 { body_name(model, body) } else { geom_name(model, geom) };
            let identity = |mask_id| ElementIdentity { mask_id, name: name.into(), body: None };
            if body > 0 && of_body[body] > 0 {
                let id: i32 = of_body[body];
                table[id as usize - 1].geoms.push(geom_name(model, geom));
                return identity(id);
            }
            let id = table.len() as i32 + 1;
            of_body[body] = id;
            let (name, root) = (body_name(model, body), body_name(model, model.body_rootid()[body] as usize));
            let object = if body == 0 { geom_name(model, geom) } else { root };
            table.push(MaskId {
                id,
                object,
                link: (body > 0).then(|| name.clone()),
                class: if body == 0 { "world" } else { "body" }.into(),
                body: name,
                geoms: vec![geom_name(model, geom)],
            });
            identity(id)
        })
        .collect();
    let of_drawable = deforming::visible_elements(model)
        .into_iter()
        .map(|drawable| {
            let (id, name) = (table.len() as i32 + 1, drawable.name(model));
            table.push(MaskId {
                id,
                object: name.clone(),
                link: None,
                class: drawable.class().into(),
                body: body_name(model, 0),
                geoms: Vec::new(),
            });
            (drawable, ElementIdentity { mask_id: id, name: name.into(), body: None })
        })
        .collect();
    let shown = (0..if sites { model.nsite() } else { 0 })
        .filter(|&site| visibility::is_visible(model.site_group()[site], &color::of_site(model, site)));
    let of_site = shown
        .map(|site| {
            let body = model.site_bodyid()[site] as usize;
            let own = model.name(ObjectKind::Site, site).unwrap_or_else(|| format!("site {site}"));
            let name = if body > 0 { body_name(model, body) } else { own.clone() };
            if body == 0 || of_body[body] == 0 {
                let id = table.len() as i32 + 1;
                of_body[body] = id;
                table.push(MaskId {
                    id,
                    object: if body > 0 { body_name(model, model.body_rootid()[body] as usize) } else { own },
                    link: (body > 0).then(|| name.clone()),
                    class: if body == 0 { "world" } else { "body" }.into(),
                    body: body_name(model, body),
                    geoms: Vec::new(),
                });
            }
            (site, ElementIdentity { mask_id: of_body[body], name: name.into(), body: None })
        })
        .collect();
    MaskIdMap { table: table.into(), of_geom, of_site, of_drawable }
}

/// Owner of a geom or a tendon in a simulation.
#[derive(Clone, Debug)]
pub(crate) struct ElementOwner {
    pub(crate) id: i32,
    pub(crate) object: String,
    pub(crate) link: Option<String>,
    pub(crate) class: String,
    /// Index on the body axis of sensors; `None` for the world.
    pub(crate) body: Option<u32>,
}

/// Mask ids of a simulation, from the owners of all geoms and of rendered elements whose shape changes.
pub(crate) fn of_simulation(
    model: &Model,
    owners: &[ElementOwner],
    of_drawables: &[(DeformingElement, ElementOwner)],
) -> MaskIdMap {
    let mut table: BTreeMap<i32, MaskId> = BTreeMap::new();
    for (geom, owner) in owners.iter().enumerate() {
        let entry = table.entry(owner.id).or_insert_with(|| MaskId {
            id: owner.id,
            object: owner.object.clone(),
            link: owner.link.clone(),
            class: owner.class.clone(),
            body: body_name(model, model.geom_bodyid()[geom] as usize),
            geoms: Vec::new(),
        });
        entry.geoms.push(geom_name(model, geom));
    }
    for (_, owner) in of_drawables {
        table.entry(owner.id).or_insert_with(|| MaskId {
            id: owner.id,
            object: owner.object.clone(),
            link: owner.link.clone(),
            class: owner.class.clone(),
            body: body_name(model, 0),
            geoms: Vec::new(),
        });
    }
    let identity = |owner: &ElementOwner| {
        let name = match &owner.link {
            Some(link) => format!("{}/{link}", owner.object).into(),
            None => owner.object.as_str().into(),
        };
        ElementIdentity { mask_id: owner.id, name, body: owner.body }
    };
    MaskIdMap {
        table: table.into_values().collect(),
        of_geom: owners.iter().map(identity).collect(),
        of_site: Vec::new(),
        of_drawable: of_drawables.iter().map(|(drawable, owner)| (*drawable, identity(owner))).collect(),
    }
}

/// Owners of the visible spatial tendons, which belong to robots and parts from MJCF files.
pub(crate) fn tendon_owners(model: &Model, contents: &EntitySet) -> Vec<(DeformingElement, ElementOwner)> {
    let of_robots = contents.robots.iter().map(|robot| {
        (robot.uid(), robot.tendons(), robot.mask_id(robot.description().links.len()), robot.semantic_class())
    });
    let of_parts = contents.mjcf_models.iter().map(|part| {
        let class = part.cfg().semantic_class.as_deref().unwrap_or("mjcf");
        (part.uid(), &part.names().tendons[..], part.mask_id(part.model().nbody()), class)
    });
    let mut owners = Vec::new();
    for (uid, tendons, first_id, class) in of_robots.chain(of_parts) {
        for (id, name) in (first_id..).zip(tendons) {
            if let Some(tendon) = model.id(ObjectKind::Tendon, &format!("{uid}/{name}")) {
                let owner =
                    ElementOwner { id, object: uid.into(), link: Some(name.clone()), class: class.into(), body: None };
                owners.push((DeformingElement::Tendon(tendon), owner));
            }
        }
    }
    let shown = deforming::visible_elements(model);
    owners.retain(|(drawable, _)| shown.contains(drawable));
    owners
}

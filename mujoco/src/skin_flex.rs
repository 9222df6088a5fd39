//! Elements of a model with changing shape: skins (2.2.2 and 4.x) and flexes (4.x).

use super::model::Model;
use super::visual::{as_rows, checked_slice};
use mujoco_sys::fields::model as fields;

/// A skin: a mesh whose vertices follow bodies.
#[derive(Clone, Copy, Debug)]
pub struct SkinArrays<'a> {
    /// Index of the material; -1 without a material.
    pub material: i32,
    /// Group; viewers show 0 to 2.
    pub group: i32,
    /// Color and opacity, 0..=1.
    pub rgba: &'a [f32],
    /// Distance by which vertices are moved along their normals \[m\].
    pub inflate: f32,
    /// Vertices in the bind pose, in the world frame \[m\].
    pub positions: &'a [[f32; 3]],
    /// Texture coordinates of vertices, with v downward; empty for a skin without texture coordinates.
    pub texcoords: &'a [[f32; 2]],
    /// Vertices of each triangle, as indices in [`positions`](Self::positions).
    pub faces: &'a [[i32; 3]],
    bones: [usize; 2],
    first_vertices: &'a [i32],
    vertex_counts: &'a [i32],
    bind_positions: &'a [[f32; 3]],
    bind_orientations: &'a [[f32; 4]],
    bodies: &'a [i32],
    vertices: &'a [i32],
    weights: &'a [f32],
}

/// A body that moves vertices of a skin.
#[derive(Clone, Copy, Debug)]
pub struct Bone<'a> {
    /// Index of the body in the model (MuJoCo's body id).
    pub body: usize,
    /// Position of the body in the bind pose, in the world frame \[m\].
    pub position: [f32; 3],
    /// Orientation of the body in the bind pose, in the world frame, wxyz.
    pub orientation: [f32; 4],
    /// Vertices that the body moves, as indices within the skin.
    pub vertices: &'a [i32],
    /// The weight of the body for each of these vertices.
    pub weights: &'a [f32],
}

impl<'a> SkinArrays<'a> {
    /// Bodies that move the vertices of the skin.
    pub fn bones(self) -> impl Iterator<Item = Bone<'a>> {
        let [first, count] = self.bones;
        (first..first + count).map(move |bone| {
            let (vertex, vertices) = (i64::from(self.first_vertices[bone]), i64::from(self.vertex_counts[bone]));
            Bone {
                body: self.bodies[bone] as usize,
                position: self.bind_positions[bone],
                orientation: self.bind_orientations[bone],
                vertices: checked_slice(self.vertices, vertex, vertices),
                weights: checked_slice(self.weights, vertex, vertices),
            }
        })
    }
}

/// A deformable body (flex, 4.x) of line segments, triangles or tetrahedra.
#[derive(Clone, Copy, Debug)]
pub struct FlexArrays<'a> {
    /// Number of dimensions: 1 for cables, 2 for cloth, 3 for solids.
    pub dimensions: usize,
    /// Index of the material; -1 without a material.
    pub material: i32,
    /// Group; viewers show 0 to 2.
    pub group: i32,
    /// Color and opacity, 0..=1.
    pub rgba: &'a [f32],
    /// Radius around the elements \[m\].
    pub radius: f64,
    /// True if triangles are shaded flat.
    pub flat_shading: bool,
    /// Index of the first vertex among the vertices of all flexes.
    pub first_vertex: usize,
    /// Number of vertices.
    pub vertices: usize,
    /// Vertices of the elements, `dimensions` + 1 for each, as indices within the flex.
    pub elements: &'a [i32],
    /// Vertices of the boundary elements, `dimensions` for each, as indices within the flex.
    pub shell: &'a [i32],
    /// Texture coordinates from the first of this flex to the end of the model's array, with v downward; empty for a
    /// flex without texture coordinates.
    pub texcoords: &'a [[f32; 2]],
    /// Texture coordinates of the elements' vertices, as indices in [`texcoords`](Self::texcoords), in the layout of
    /// [`elements`](Self::elements).
    pub element_texcoords: &'a [i32],
    /// Vertices of each edge, as indices within the flex.
    pub edges: &'a [[i32; 2]],
}

/// The model's array `name`.
macro_rules! array {
    ($model:expr, $name:ident) => {{
        // SAFETY: the model is alive as long as the borrow that the caller holds, and nothing writes to a shared model.
        unsafe { fields::$name($model.raw()) }
    }};
}

impl Model {
    /// Arrays of a skin.
    ///
    /// # Panics
    /// There is no such skin.
    pub fn skin(&self, skin: usize) -> SkinArrays<'_> {
        let pick = |values: &[i32]| i64::from(values[skin]);
        let (vertex, vertices) = (pick(array!(self, skin_vertadr)), pick(array!(self, skin_vertnum)));
        let (face, faces) = (pick(array!(self, skin_faceadr)), pick(array!(self, skin_facenum)));
        let (bone, bones) = (pick(array!(self, skin_boneadr)), pick(array!(self, skin_bonenum)));
        let texcoord = pick(array!(self, skin_texcoordadr));
        SkinArrays {
            material: array!(self, skin_matid)[skin],
            group: array!(self, skin_group)[skin],
            rgba: &array!(self, skin_rgba)[4 * skin..4 * skin + 4],
            inflate: array!(self, skin_inflate)[skin],
            positions: checked_slice(as_rows(array!(self, skin_vert)), vertex, vertices),
            texcoords: checked_slice(as_rows(array!(self, skin_texcoord)), texcoord, vertices),
            faces: checked_slice(as_rows(array!(self, skin_face)), face, faces),
            bones: [bone, bones].map(|n| usize::try_from(n).unwrap_or(0)),
            first_vertices: array!(self, skin_bonevertadr),
            vertex_counts: array!(self, skin_bonevertnum),
            bind_positions: as_rows(array!(self, skin_bonebindpos)),
            bind_orientations: as_rows(array!(self, skin_bonebindquat)),
            bodies: array!(self, skin_bonebodyid),
            vertices: array!(self, skin_bonevertid),
            weights: array!(self, skin_bonevertweight),
        }
    }

    /// True if the stiffness or the damping of a tendon has terms of higher order (4.x); false on 2.2.2.
    ///
    /// # Panics
    /// There is no such tendon.
    #[cfg(mj4)]
    pub fn tendon_has_nonlinear_terms(&self, tendon: usize) -> bool {
        let order = mujoco_sys::mjNPOLY as usize;
        let of = |values: &[f64]| values[order * tendon..order * (tendon + 1)].iter().any(|x| *x != 0.0);
        of(array!(self, tendon_stiffnesspoly)) || of(array!(self, tendon_dampingpoly))
    }

    /// True if the stiffness or the damping of a tendon has terms of higher order (4.x); false on 2.2.2.
    #[cfg(not(mj4))]
    pub fn tendon_has_nonlinear_terms(&self, _tendon: usize) -> bool {
        false
    }

    /// True if gravity is nonzero and not disabled by the flag `gravity`.
    pub fn has_gravity(&self) -> bool {
        let disabled = self.header().opt.disableflags as u32 & mujoco_sys::mjDSBL_GRAVITY;
        disabled == 0 && self.gravity().iter().map(|g| g * g).sum::<f64>().sqrt() > 1e-15
    }

    /// Arrays of a flex; `None` on 2.2.2, which has no flexes.
    ///
    /// # Panics
    /// There is no such flex.
    #[cfg(mj4)]
    pub fn flex(&self, flex: usize) -> Option<FlexArrays<'_>> {
        let pick = |values: &[i32]| i64::from(values[flex]);
        let size = |n: i64| usize::try_from(n).unwrap_or(0);
        let dimensions = pick(array!(self, flex_dim));
        let (vertex, vertices) = (pick(array!(self, flex_vertadr)), pick(array!(self, flex_vertnum)));
        let (edge, edges) = (pick(array!(self, flex_edgeadr)), pick(array!(self, flex_edgenum)));
        let texcoord = pick(array!(self, flex_texcoordadr));
        let data = (pick(array!(self, flex_elemdataadr)), pick(array!(self, flex_elemnum)) * (dimensions + 1));
        let shell = (pick(array!(self, flex_shelldataadr)), pick(array!(self, flex_shellnum)) * dimensions);
        let texcoords: &[[f32; 2]] = as_rows(array!(self, flex_texcoord));
        let begin = usize::try_from(texcoord).ok();
        Some(FlexArrays {
            dimensions: size(dimensions),
            material: array!(self, flex_matid)[flex],
            group: array!(self, flex_group)[flex],
            rgba: &array!(self, flex_rgba)[4 * flex..4 * flex + 4],
            radius: array!(self, flex_radius)[flex],
            flat_shading: super::arrays::is_set(array!(self, flex_flatskin)[flex]),
            first_vertex: size(vertex),
            vertices: size(vertices),
            elements: checked_slice(array!(self, flex_elem), data.0, data.1),
            shell: checked_slice(array!(self, flex_shell), shell.0, shell.1),
            texcoords: begin.and_then(|begin| texcoords.get(begin..)).unwrap_or(&[]),
            element_texcoords: checked_slice(array!(self, flex_elemtexcoord), data.0, data.1),
            edges: checked_slice(as_rows(array!(self, flex_edge)), edge, edges),
        })
    }

    /// Arrays of a flex; `None` on 2.2.2, which has no flexes.
    #[cfg(not(mj4))]
    pub fn flex(&self, _flex: usize) -> Option<FlexArrays<'_>> {
        None
    }
}

impl super::Data {
    /// Vertex positions of all flexes in the world \[m\], shape (nflexvert, 3); empty on 2.2.2.
    #[cfg(mj4)]
    pub fn flex_vertices(&self) -> &[[f64; 3]] {
        // SAFETY: model and data are alive as long as `self`; only `&mut self` writes.
        as_rows(unsafe { mujoco_sys::fields::data::flexvert_xpos(self.model().raw(), self.raw()) })
    }

    /// Vertex positions of all flexes in the world \[m\], shape (nflexvert, 3); empty on 2.2.2.
    #[cfg(not(mj4))]
    pub fn flex_vertices(&self) -> &[[f64; 3]] {
        &[]
    }
}

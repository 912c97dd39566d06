// @ts-check
/** The 3-D view: drawn when something has changed, never in a loop. */
import {
  AmbientLight, AxesHelper, Box3, BufferGeometry, DirectionalLight, DoubleSide, Float32BufferAttribute, GridHelper,
  HemisphereLight, Line, LineBasicMaterial, Mesh, MeshStandardMaterial, PCFShadowMap, PerspectiveCamera, PlaneGeometry,
  Scene, ShadowMaterial, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "/vendor/three/OrbitControls.js";
import { Figure, Shapes } from "./bodies.js";
import { Gizmo } from "./gizmo.js";

const EYES = { space: [1.25, -1.5, 0.85], front: [2.1, 0, 0.12], side: [0, -2.1, 0.12], top: [0, -0.001, 2.3] };

const FINE = Math.min(devicePixelRatio, 2);
const SLOW = 60; // [ms] between two pictures of something that moves

export class View {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {import("./types.js").Arm} arm
   */
  constructor(canvas, arm) {
    this.canvas = canvas;
    this.arm = arm;
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setPixelRatio(FINE);
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(36, 1, arm.reach / 100, arm.reach * 30);
    this.camera.up.set(0, 0, 1);
    this.waiting = false;
    this.last = 0; // [ms] when it was drawn
    this.slow = 0; // pictures in a row that came late
    this.coarse = false;
    this.resting = 0;
    /** @type {Line | null} */
    this.way = null;
    this.shapes = new Shapes(arm);
    this.tube = new MeshStandardMaterial({ roughness: 0.55, metalness: 0.05 });
    this.drum = new MeshStandardMaterial({ roughness: 0.5, metalness: 0.1 });
    this.solid = new Figure(this.shapes, this.tube, this.drum, true);
    this.scene.add(this.solid.group);
    /** @type {Map<string, Figure>} colour and faintness -> spare ghosts */
    this.ghosts = new Map();
    this.shown = /** @type {Figure[]} */ ([]);
    this.lights();
    this.floor();
    const length = 0.14 * arm.reach;
    this.base = new AxesHelper(length);
    this.base.matrixAutoUpdate = false;
    this.base.matrix.fromArray(arm.base.flat()).transpose();
    this.tool = new AxesHelper(length);
    this.tool.matrixAutoUpdate = false;
    for (const axes of [this.base, this.tool]) axes.setColors(0xd62728, 0x2ca02c, 0x1f4fd6);
    this.scene.add(this.base, this.tool);
    this.orbit = new OrbitControls(this.camera, canvas);
    this.orbit.addEventListener("change", () => this.draw());
    this.gizmo = new Gizmo(this);
    this.middle = new Vector3();
    this.theme();
    new ResizeObserver(() => this.size()).observe(canvas);
  }

  lights() {
    const r = this.arm.reach;
    const sun = new DirectionalLight(0xffffff, 2.4);
    sun.position.set(1.2 * r, -1.6 * r, 3 * r);
    sun.castShadow = true;
    sun.shadow.mapSize.set(1024, 1024);
    sun.shadow.normalBias = 0.006 * r; // two texels: a tube does not shade itself in stripes
    Object.assign(sun.shadow.camera, { left: -1.5 * r, right: 1.5 * r, top: 1.5 * r, bottom: -1.5 * r, far: 8 * r });
    this.scene.add(sun, new HemisphereLight(0xffffff, 0x8090a0, 1.3), new AmbientLight(0xffffff, 0.25));
  }

  floor() {
    const r = this.arm.reach;
    const step = 10 ** Math.floor(Math.log10(r / 2));
    const half = Math.ceil((1.4 * r) / step) * step;
    const z = Math.min(this.arm.base[2][3], 0);
    this.grid = new GridHelper(2 * half, (2 * half) / step);
    this.grid.rotateX(Math.PI / 2);
    this.grid.position.z = z - 0.001 * r;
    const shade = new Mesh(new PlaneGeometry(4 * r, 4 * r), new ShadowMaterial({ opacity: 0.22, side: DoubleSide }));
    shade.position.z = z - 0.002 * r;
    shade.receiveShadow = true;
    this.scene.add(this.grid, shade);
    this.step = step;
  }

  /** Take the colours of the page's theme. */
  theme() {
    const dark = document.documentElement.dataset.theme === "dark";
    this.tube.color.set(dark ? 0xc6d0da : 0xdfe4e9);
    this.drum.color.set(dark ? 0x4d9de0 : 0x0072b2);
    const lines = /** @type {any} */ (this.grid).material;
    lines.vertexColors = false;
    lines.color.set(dark ? 0x38424d : 0xcfd6dd);
    lines.needsUpdate = true;
    this.draw();
  }

  /**
   * Look from one of the standard sides.
   * @param {string} name
   */
  look(name) {
    const [x, y, z] = /** @type {Object<string, number[]>} */ (EYES)[name];
    this.scene.updateMatrixWorld();
    const box = new Box3().setFromObject(this.solid.group);
    for (const ghost of this.shown) box.expandByObject(ghost.group);
    const size = Math.max(0.9 * this.arm.reach, 0.8 * box.getSize(this.middle).length());
    box.getCenter(this.middle);
    this.orbit.target.copy(this.middle);
    this.camera.position.set(x, y, z).multiplyScalar(size).add(this.middle);
    this.orbit.update();
    this.draw();
  }

  /** @param {number[]} q */
  pose(q) {
    this.solid.pose(q);
    if (this.solid.tool) this.tool.matrix.fromArray(this.solid.tool).transpose();
    this.tool.matrixWorldNeedsUpdate = true;
    this.draw();
  }

  /**
   * Show ghosts instead of those shown.
   * @param {{joints: number[], colour: string, faint: boolean}[]} wanted
   */
  haunt(wanted) {
    for (const ghost of this.shown) ghost.group.visible = false;
    this.shown = wanted.map(({ joints, colour, faint }) => {
      const ghost = this.ghost(`${colour}${faint ? " faint" : ""}`, colour, faint);
      ghost.group.visible = true;
      ghost.pose(joints, this.solid);
      return ghost;
    });
    this.draw();
  }

  /** @param {string} name @param {string} colour @param {boolean} faint */
  ghost(name, colour, faint) {
    let spare = this.ghosts.get(name);
    while (spare && this.shownNow(spare)) spare = this.ghosts.get((name += "'"));
    if (!spare) {
      const skin = new MeshStandardMaterial({
        color: colour, transparent: true, opacity: faint ? 0.13 : 0.36, depthWrite: false, roughness: 0.8,
        polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 2, // behind what it coincides with
      });
      spare = new Figure(this.shapes, skin, skin, false);
      this.ghosts.set(name, spare);
      this.scene.add(spare.group);
    }
    return spare;
  }

  /** @param {Figure} ghost */
  shownNow(ghost) {
    return ghost.group.visible;
  }

  /** Draw the tip's way through a program. @param {number[][]} tips */
  trail(tips) {
    if (this.way) {
      this.scene.remove(this.way);
      this.way.geometry.dispose();
    }
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new Float32BufferAttribute(tips.flat(), 3));
    this.way = new Line(geometry, new LineBasicMaterial({ color: 0xd55e00 }));
    this.way.frustumCulled = false;
    this.scene.add(this.way);
    this.draw();
  }

  size() {
    const { clientWidth, clientHeight } = this.canvas;
    if (!clientWidth || !clientHeight) return;
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    // A narrow window sees as much to its sides as a square one.
    this.camera.fov = this.camera.aspect < 1 ? 36 / this.camera.aspect ** 0.7 : 36;
    this.camera.updateProjectionMatrix();
    this.now();
  }

  /** Where drawing is slow, as without a graphics card, draw coarsely what moves, and finely what rests. */
  pace() {
    const now = performance.now();
    const gap = now - this.last;
    this.last = now;
    this.slow = gap < 400 && gap > SLOW ? this.slow + 1 : 0;
    if (this.slow >= 3 && !this.coarse) {
      this.coarse = true;
      this.renderer.setPixelRatio(FINE / 2);
      this.canvas.dataset.coarse = "yes";
    }
    if (!this.coarse) return;
    clearTimeout(this.resting);
    this.resting = setTimeout(() => {
      this.coarse = false;
      this.renderer.setPixelRatio(FINE);
      delete this.canvas.dataset.coarse;
      this.draw();
    }, 400);
  }

  /** Draw at the next opportunity. */
  draw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => this.now());
  }

  now() {
    this.waiting = false;
    this.pace();
    this.renderer.render(this.scene, this.camera);
    const at = this.gizmo.handle.getWorldPosition(new Vector3()).project(this.camera);
    const { width, height } = this.canvas.getBoundingClientRect();
    // For tests and other programs that drag the handle: where it is in the picture [px].
    this.canvas.dataset.handle = `${((at.x + 1) / 2) * width} ${((1 - at.y) / 2) * height}`;
  }
}

(* The theorem behind a certificate of a rounding guarantee, over the rational numbers. See the docstring of
   gpbnb/bounds/check.py for the claim in words, and README.md for what is not proved here. *)

Require Import QArith Qabs Lqa Lia List Arith Setoid.
Open Scope Q_scope.

(* -- finite sums -- *)

Fixpoint sum (n : nat) (f : nat -> Q) : Q :=
  match n with O => 0 | S m => sum m f + f m end.

Lemma sum_ext n f g : (forall i, (i < n)%nat -> f i == g i) -> sum n f == sum n g.
Proof.
  induction n as [|n IH]; intros H; simpl; [reflexivity|].
  rewrite (IH (fun i h => H i (Nat.lt_lt_succ_r _ _ h))), (H n (Nat.lt_succ_diag_r n)). reflexivity.
Qed.

Lemma sum_le n f g : (forall i, (i < n)%nat -> f i <= g i) -> sum n f <= sum n g.
Proof.
  induction n as [|n IH]; intros H; simpl; [lra|].
  apply Qplus_le_compat; [apply IH; intros; apply H; lia|apply H; lia].
Qed.

Lemma sum_plus n f g : sum n (fun i => f i + g i) == sum n f + sum n g.
Proof. induction n as [|n IH]; simpl; [lra|rewrite IH; lra]. Qed.

Lemma sum_scale n c f : sum n (fun i => c * f i) == c * sum n f.
Proof. induction n as [|n IH]; simpl; [lra|rewrite IH; ring]. Qed.

Lemma sum_zero n : sum n (fun _ => 0) == 0.
Proof. induction n as [|n IH]; simpl; [reflexivity|rewrite IH; reflexivity]. Qed.

Lemma sum_swap n m (f : nat -> nat -> Q) :
  sum n (fun i => sum m (f i)) == sum m (fun j => sum n (fun i => f i j)).
Proof.
  induction n as [|n IH]; simpl.
  - rewrite sum_zero. reflexivity.
  - rewrite IH, sum_plus. reflexivity.
Qed.

Lemma sum_abs n f : Qabs (sum n f) <= sum n (fun i => Qabs (f i)).
Proof.
  induction n as [|n IH]; simpl; [apply Qle_refl|].
  eapply Qle_trans; [apply Qabs_triangle|]. apply Qplus_le_compat; [exact IH|apply Qle_refl].
Qed.

Lemma sum_nonnegative n f : (forall i, (i < n)%nat -> 0 <= f i) -> 0 <= sum n f.
Proof. intros H. rewrite <- (sum_zero n). apply sum_le. exact H. Qed.

(* -- rows, columns and matrices -- *)

Definition vector := nat -> Q.
Definition matrix := nat -> nat -> Q.

Section Recursion.

Variable n : nat.

Definition dot (a x : vector) : Q := sum n (fun j => a j * x j).
Definition sizes (a x : vector) : Q := sum n (fun j => Qabs (a j) * x j).
Definition through (a : vector) (F : matrix) : vector := fun r => sum n (fun j => a j * F j r).
Definition unit_row (i : nat) : vector := fun j => if Nat.eqb i j then 1 else 0.

Lemma dot_plus a x y : dot a (fun j => x j + y j) == dot a x + dot a y.
Proof. unfold dot. rewrite <- sum_plus. apply sum_ext. intros. ring. Qed.

Lemma dot_minus_row a b x : dot (fun j => a j - b j) x == dot a x - dot b x.
Proof.
  unfold dot.
  assert (H : sum n (fun j => a j * x j) - sum n (fun j => b j * x j)
              == sum n (fun j => a j * x j) + (-(1)) * sum n (fun j => b j * x j)) by ring.
  rewrite H, <- sum_scale, <- sum_plus. apply sum_ext. intros. ring.
Qed.

Lemma dot_ext a x y : (forall j, (j < n)%nat -> x j == y j) -> dot a x == dot a y.
Proof. intros H. unfold dot. apply sum_ext. intros j h. rewrite (H j h). reflexivity. Qed.

Lemma dot_through a F x : dot a (fun i => sum n (fun r => F i r * x r)) == dot (through a F) x.
Proof.
  unfold dot, through.
  transitivity (sum n (fun i => sum n (fun r => a i * F i r * x r))).
  - apply sum_ext. intros i _. rewrite <- sum_scale. apply sum_ext. intros. ring.
  - rewrite sum_swap. apply sum_ext. intros r _.
    rewrite Qmult_comm, <- sum_scale. apply sum_ext. intros. ring.
Qed.

Lemma dot_within a x b : (forall j, (j < n)%nat -> Qabs (x j) <= b j) -> Qabs (dot a x) <= sizes a b.
Proof.
  intros H. unfold dot, sizes. eapply Qle_trans; [apply sum_abs|]. apply sum_le. intros j h. rewrite Qabs_Qmult.
  pose proof (H j h). pose proof (Qabs_nonneg (a j)). nra.
Qed.

Lemma sum_beyond m i (f : vector) : (m <= i)%nat -> sum m (fun j => unit_row i j * f j) == 0.
Proof.
  induction m as [|m IH]; intros h; simpl; [reflexivity|].
  rewrite IH by lia. unfold unit_row.
  assert (Nat.eqb i m = false) as -> by (apply Nat.eqb_neq; lia). ring.
Qed.

Lemma dot_unit i x : (i < n)%nat -> dot (unit_row i) x == x i.
Proof.
  unfold dot. induction n as [|m IH]; intros h; [lia|]. simpl.
  destruct (Nat.eq_dec i m) as [->|d].
  - rewrite sum_beyond by lia. unfold unit_row. rewrite Nat.eqb_refl. ring.
  - rewrite IH by lia. unfold unit_row.
    assert (Nat.eqb i m = false) as -> by (apply Nat.eqb_neq; lia). ring.
Qed.

(* A disturbance that is a sum of columns, each times a number within its limit, and of a slack. *)

Lemma columns_bound (g : nat) (G : nat -> vector) (rho h : nat -> Q) (w s slack : vector) a :
  (forall j, (j < n)%nat -> w j == sum g (fun q => G q j * rho q) + s j) ->
  (forall q, (q < g)%nat -> Qabs (rho q) <= h q) ->
  (forall j, (j < n)%nat -> Qabs (s j) <= slack j) ->
  Qabs (dot a w) <= sum g (fun q => Qabs (dot a (G q)) * h q) + sizes a slack.
Proof.
  intros Hw Hr Hs.
  assert (E : dot a w == sum g (fun q => dot a (G q) * rho q) + dot a s).
  { rewrite (dot_ext a w (fun j => sum g (fun q => G q j * rho q) + s j) Hw), dot_plus.
    apply Qplus_comp; [|reflexivity]. unfold dot.
    transitivity (sum n (fun j => sum g (fun q => a j * G q j * rho q))).
    - apply sum_ext. intros j _. rewrite <- sum_scale. apply sum_ext. intros. ring.
    - rewrite sum_swap. apply sum_ext. intros q _. rewrite (Qmult_comm _ (rho q)), <- sum_scale.
      apply sum_ext. intros. ring. }
  rewrite E. eapply Qle_trans; [apply Qabs_triangle|].
  pose proof (dot_within a s slack Hs) as Bs.
  assert (Bc : Qabs (sum g (fun q => dot a (G q) * rho q)) <= sum g (fun q => Qabs (dot a (G q)) * h q)).
  { eapply Qle_trans; [apply sum_abs|]. apply sum_le. intros q hq. rewrite Qabs_Qmult.
    pose proof (Hr q hq). pose proof (Qabs_nonneg (dot a (G q))). nra. }
  lra.
Qed.

(* -- the error recursion: e_k = F_k e_{k-1} + w_k -- *)

Variable F : nat -> matrix.
Variable e w : nat -> vector.
Hypothesis recursion : forall k i, (i < n)%nat -> e (S k) i == sum n (fun r => F (S k) i r * e k r) + w (S k) i.

Definition residual (C : nat -> vector) (k l : nat) : vector := fun r => through (C l) (F (k - l)) r - C (S l) r.

(* The telescoping sum of check.py and of the chapter on the guarantee. *)

Theorem telescope (C : nat -> vector) (k L : nat) : (L <= k)%nat ->
  dot (C O) (e k) ==
  sum L (fun l => dot (C l) (w (k - l)) + dot (residual C k l) (e (k - l - 1))) + dot (C L) (e (k - L)).
Proof.
  induction L as [|L IH]; intros h.
  - simpl. rewrite Nat.sub_0_r. ring.
  - rewrite IH by lia. simpl.
    destruct (k - L)%nat as [|j] eqn:E; [lia|].
    assert (k - S L = j)%nat as -> by lia.
    replace (S j - 1)%nat with j by lia.
    assert (step : dot (C L) (e (S j)) == dot (through (C L) (F (S j))) (e j) + dot (C L) (w (S j))).
    { rewrite (dot_ext (C L) (e (S j)) (fun i => sum n (fun r => F (S j) i r * e j r) + w (S j) i))
        by (intros; apply recursion; assumption).
      rewrite dot_plus, dot_through. reflexivity. }
    assert (res : dot (residual C k L) (e j) == dot (through (C L) (F (S j))) (e j) - dot (C (S L)) (e j)).
    { unfold residual. rewrite E. apply dot_minus_row. }
    rewrite step, res. ring.
Qed.

(* -- what the checker verifies -- *)

Variable b : vector.
(* A bound of |a w_k|, valid as long as the error before the step is within b. *)
Variable W : nat -> vector -> Q.
Hypothesis disturbances : forall k a,
  (forall i, (i < n)%nat -> Qabs (e k i) <= b i) -> Qabs (dot a (w (S k))) <= W (S k) a.

Definition within (k : nat) : Prop := forall i, (i < n)%nat -> Qabs (e k i) <= b i.

Lemma one_condition (C : nat -> vector) (k L : nat) (last : Q) : (L <= k)%nat ->
  (forall j, (j < k)%nat -> within j) ->
  Qabs (dot (C L) (e (k - L))) <= last ->
  Qabs (dot (C O) (e k)) <= sum L (fun l => W (k - l) (C l) + sizes (residual C k l) b) + last.
Proof.
  intros h before tail. rewrite (telescope C k L h).
  eapply Qle_trans; [apply Qabs_triangle|]. apply Qplus_le_compat; [|exact tail].
  eapply Qle_trans; [apply sum_abs|]. apply sum_le. intros l hl.
  eapply Qle_trans; [apply Qabs_triangle|]. apply Qplus_le_compat.
  - destruct (k - l)%nat as [|j] eqn:E; [lia|]. apply disturbances. apply before. lia.
  - apply dot_within. intros r hr. apply (before (k - l - 1)%nat); [lia|exact hr].
Qed.

Lemma unit_entry (C : nat -> vector) k i : (forall j, (j < n)%nat -> C O j == unit_row i j) -> (i < n)%nat ->
  Qabs (e (S k) i) == Qabs (dot (C O) (e (S k))).
Proof.
  intros h0 hi. apply Qabs_wd. rewrite <- (dot_unit i (e (S k)) hi). unfold dot. apply sum_ext.
  intros j hj. rewrite (h0 j hj). reflexivity.
Qed.

(* The general theorem: a condition for each step and state, with at least one step back. *)

Theorem for_ever_by_conditions : within 0 ->
  (forall k i, (i < n)%nat -> exists (L : nat) (C : nat -> vector), (1 <= L <= S k)%nat /\
     (forall j, (j < n)%nat -> C O j == unit_row i j) /\
     sum L (fun l => W (S k - l) (C l) + sizes (residual C (S k) l) b) + sizes (C L) b <= b i) ->
  forall k, within k.
Proof.
  intros start conditions k. induction k as [k IH] using lt_wf_ind.
  destruct k as [|k]; [exact start|]. intros i hi.
  destruct (conditions k i hi) as [L [C [hL [h0 total]]]].
  rewrite (unit_entry C k i h0 hi).
  eapply Qle_trans; [|exact total].
  apply one_condition; [lia|exact IH|]. apply dot_within. intros r hr. apply (IH (S k - L)%nat); [lia|exact hr].
Qed.

(* What a certificate states: F and W repeat with period P after step `first`; the steps up to it have been bounded, and
   `reach` bounds rows times the error after it. Every phase q < P has rows C q, which start with the unit vectors. *)

Variables (first P : nat).
Hypothesis period : (0 < P)%nat.
Variable phase_of : nat -> nat. (* of step first + 1 + j: j modulo P *)
Hypothesis phases : forall j, phase_of j = (j mod P)%nat.
Hypothesis F_repeats : forall j i r, F (first + 1 + j) i r == F (first + 1 + phase_of j) i r.
Hypothesis W_repeats : forall j a, W (first + 1 + j) a == W (first + 1 + phase_of j) a.
Hypothesis W_extensional : forall k a c, (forall j, (j < n)%nat -> a j == c j) -> W k a == W k c.

Variable reach : vector -> Q.
Hypothesis reached : forall a, Qabs (dot a (e first)) <= reach a.

(* Rows of state i in phase q, L of them; at lag l they meet the step of phase q - l, modulo P. *)
Variable L : nat.
Hypothesis one_row : (1 <= L)%nat.
Variable rows : nat -> nat -> nat -> vector.
Hypothesis rows_begin : forall q i j, (q < P)%nat -> (i < n)%nat -> (j < n)%nat -> rows q i O j == unit_row i j.

Definition back (q l : nat) : nat := ((q + l * (P - 1)) mod P)%nat.
Definition term (q i l : nat) : Q :=
  W (first + 1 + back q l) (rows q i l) +
  sizes (fun r => through (rows q i l) (F (first + 1 + back q l)) r - rows q i (S l) r) b.

Hypothesis early : forall k, (k <= first)%nat -> within k.
Hypothesis soon : forall q i j, (q < P)%nat -> (i < n)%nat -> (1 <= j <= L)%nat -> ((j - 1) mod P = q)%nat ->
  sum j (term q i) + reach (rows q i j) <= b i.
Hypothesis late : forall q i, (q < P)%nat -> (i < n)%nat -> sum L (term q i) + sizes (rows q i L) b <= b i.

Lemma back_phase j l : (l <= j)%nat -> back (j mod P) l = ((j - l) mod P)%nat.
Proof.
  intros h. unfold back. rewrite Nat.add_mod_idemp_l by lia.
  replace (j + l * (P - 1))%nat with (j - l + l * P)%nat by nia.
  apply Nat.mod_add. lia.
Qed.

Lemma term_is_condition j i l : (l <= j)%nat ->
  W (first + 1 + j - l) (rows (j mod P) i l) + sizes (residual (rows (j mod P) i) (first + 1 + j) l) b
  == term (j mod P) i l.
Proof.
  intros h. unfold term. rewrite back_phase by exact h.
  replace (first + 1 + j - l)%nat with (first + 1 + (j - l))%nat by lia.
  rewrite W_repeats, phases. apply Qplus_comp; [reflexivity|].
  unfold sizes, residual. apply sum_ext. intros r _. apply Qmult_comp; [|reflexivity]. apply Qabs_wd.
  replace (first + 1 + j - l)%nat with (first + 1 + (j - l))%nat by lia.
  unfold Qminus. apply Qplus_comp; [|reflexivity]. unfold through. apply sum_ext. intros s _.
  rewrite F_repeats, phases. reflexivity.
Qed.

Theorem certificate_implies_claim : forall k, within k.
Proof.
  intros k. induction k as [k IH] using lt_wf_ind.
  destruct (le_lt_dec k first) as [h|h]; [apply early; exact h|].
  intros i hi. pose (j := (k - first - 1)%nat). pose (q := (j mod P)%nat).
  assert (Hq : (q < P)%nat) by (apply Nat.mod_upper_bound; lia).
  assert (Hk : k = (first + 1 + j)%nat) by (unfold j; lia).
  assert (Hu : Qabs (e k i) == Qabs (dot (rows q i O) (e k))).
  { apply Qabs_wd. rewrite <- (dot_unit i (e k) hi). unfold dot. apply sum_ext.
    intros s hs. rewrite (rows_begin q i s Hq hi hs). reflexivity. }
  rewrite Hu.
  destruct (le_lt_dec L j) as [far|near].
  - eapply Qle_trans; [|exact (late q i Hq hi)].
    eapply Qle_trans; [apply (one_condition (rows q i) k L (sizes (rows q i L) b))|].
    + lia.
    + exact IH.
    + apply dot_within. intros r hr. apply (IH (k - L)%nat); [lia|exact hr].
    + apply Qplus_le_compat; [|apply Qle_refl]. apply sum_le. intros l hl. rewrite Hk.
      unfold q. rewrite term_is_condition by lia. apply Qle_refl.
  - eapply Qle_trans; [|apply (soon q i (S j)); [exact Hq|exact hi|lia|unfold q; f_equal; lia]].
    eapply Qle_trans; [apply (one_condition (rows q i) k (S j) (reach (rows q i (S j))))|].
    + lia.
    + exact IH.
    + replace (k - S j)%nat with first by lia. apply reached.
    + apply Qplus_le_compat; [|apply Qle_refl]. apply sum_le. intros l hl. rewrite Hk.
      unfold q. rewrite term_is_condition by lia. apply Qle_refl.
Qed.

End Recursion.

(* -- the ellipsoid takes in a segment: one size y and a bound of the square M of another, for positive t, u -- *)

Lemma cauchy_two x y t u : 0 < t -> 0 < u -> (x + y) * (x + y) * (t * u) <= (t + u) * (x * x * u + y * y * t).
Proof.
  intros ht hu.
  assert (E : (t + u) * (x * x * u + y * y * t) - (x + y) * (x + y) * (t * u) == (x * u - y * t) * (x * u - y * t)) by ring.
  assert (0 <= (x * u - y * t) * (x * u - y * t)) by (destruct (Qlt_le_dec (x * u - y * t) 0); nra). lra.
Qed.

Fixpoint total (l : list (Q * Q)) : Q := match l with nil => 0 | (y, t) :: r => y + total r end.
Fixpoint lengths (l : list (Q * Q)) : Q := match l with nil => 0 | (y, t) :: r => t + lengths r end.
Fixpoint squares (l : list (Q * Q)) : Q := match l with nil => 0 | (y, t) :: r => y * y / t + squares r end.

Theorem cauchy (l : list (Q * Q)) : (forall y t, In (y, t) l -> 0 < t) ->
  total l * total l <= lengths l * squares l.
Proof.
  induction l as [|[y t] l IH]; intros H; simpl; [lra|].
  assert (ht : 0 < t) by (apply (H y t); left; reflexivity).
  assert (Hl : forall y t, In (y, t) l -> 0 < t) by (intros a b h; apply (H a b); right; exact h).
  specialize (IH Hl).
  assert (L : 0 <= lengths l).
  { clear IH H. induction l as [|[a b] l IHl]; simpl; [lra|].
    assert (0 < b) by (apply (Hl a b); left; reflexivity).
    assert (0 <= lengths l) by (apply IHl; intros c d h; apply (Hl c d); right; exact h). lra. }
  assert (S : 0 <= squares l).
  { clear IH H L. induction l as [|[a b] l IHl]; simpl; [lra|].
    assert (hb : 0 < b) by (apply (Hl a b); left; reflexivity).
    assert (0 <= squares l) by (apply IHl; intros c d h; apply (Hl c d); right; exact h).
    assert (0 <= a * a / b). { apply Qle_shift_div_l; [exact hb|]. destruct (Qlt_le_dec a 0); nra. } lra. }
  set (T := total l) in *. set (M := squares l) in *. set (s := lengths l) in *.
  assert (D : (t + s) * (y * y / t + M) == y * y + s * (y * y / t) + t * M + s * M) by (field; lra).
  rewrite D. set (q := y * y / t).
  assert (Q1 : q * t == y * y) by (unfold q; field; lra).
  assert (q0 : 0 <= q). { unfold q. apply Qle_shift_div_l; [exact ht|]. destruct (Qlt_le_dec y 0); nra. }
  (* 2 y T <= s q + t M, since (y T)^2 <= t q s M. *)
  assert (G : (2 * y * T) * (2 * y * T) <= (s * q + t * M) * (s * q + t * M)).
  { assert (A : y * y * (T * T) <= q * t * (s * M)). { rewrite Q1.
      assert (0 <= y * y) by (destruct (Qlt_le_dec y 0); nra). nra. }
    assert (B : (s * q + t * M) * (s * q + t * M) - 4 * (q * t * (s * M)) == (s * q - t * M) * (s * q - t * M)) by ring.
    assert (0 <= (s * q - t * M) * (s * q - t * M)) by (destruct (Qlt_le_dec (s * q - t * M) 0); nra).
    assert (C : (2 * y * T) * (2 * y * T) == 4 * (y * y * (T * T))) by ring. rewrite C. lra. }
  assert (P : 0 <= s * q + t * M) by nra.
  assert (2 * y * T <= s * q + t * M).
  { destruct (Qlt_le_dec (s * q + t * M) (2 * y * T)) as [bad|good]; [|exact good]. exfalso. nra. }
  lra.
Qed.

Print Assumptions certificate_implies_claim.
Print Assumptions for_ever_by_conditions.
Print Assumptions cauchy.
